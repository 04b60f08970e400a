// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// KITTI's data set of objects, of one camera: training/{image_2,calib,label_2,velodyne}/NNNNNN,
// ImageSets/{train,val}.txt, and of each drive sequences/NN/{poses,times,calib}.txt as odometry has them. Source: the
// readme files of the devkits for objects and odometry, https://www.cvlibs.net/datasets/kitti
#include "engine/scene/palette.h"
#include "runtime/base/quote.h"
#include "tools/export/export_files.h"
#include "tools/trajectory/camera_path.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace semrover {

namespace {

constexpr double kKittiPixel = 0.5;              // where the centre of the first pixel is, here; there it is at 0
constexpr double kPartly = 0.05, kLargely = 0.5; // occlusions from which an object is called so

const char* kitti_type(uint8_t label)
{
    switch (label) {
    case 11:
        return "Pedestrian";
    case 12:
        return "Cyclist";
    case 13:
        return "Car";
    case 14:
        return "Truck";
    case 15: // a bus, a motorcycle, a bicycle
    case 17:
    case 18:
        return "Misc";
    case 16:
        return "Tram";
    default:
        return nullptr;
    }
}

double wrapped(double angle)
{
    return std::remainder(angle, 2 * std::numbers::pi);
}

// type truncated occluded alpha left top right bottom h w l x y z rotation_y. The place is the middle of the bottom
std::string kitti_line(const SeenObject& o, const CameraFrame& frame, const char* type)
{
    const Intrinsics& k = frame.intrinsics;
    const Point3 foot = transform(compose(frame.pose.world_to_camera, o.box.pose), {0, 0, -o.box.size[2] / 2});
    const Point3 front = transform(compose(frame.pose.world_to_camera, o.box.pose), {1, 0, -o.box.size[2] / 2});
    const double turn = std::atan2(-(front[2] - foot[2]), front[0] - foot[0]); // 0 looks along x, from z towards x
    const auto column = [&](double x) { return std::clamp(x - kKittiPixel, 0.0, k.width - 1.0); };
    const auto row = [&](double y) { return std::clamp(y - kKittiPixel, 0.0, k.height - 1.0); };
    const int occluded = o.occlusion < kPartly ? 0 : o.occlusion < kLargely ? 1 : 2;
    return fmt::format("{} {:.4f} {} {:.4f} {:.2f} {:.2f} {:.2f} {:.2f} {:.4f} {:.4f} {:.4f} {:.4f} {:.4f} {:.4f} "
                       "{:.5f}\n",
                       type, o.truncation, occluded, wrapped(turn - std::atan2(foot[0], foot[2])),
                       column(o.amodal.left), row(o.amodal.top), column(o.amodal.right), row(o.amodal.bottom),
                       o.box.size[2], o.box.size[1], o.box.size[0], foot[0], foot[1], foot[2], turn);
}

// a lidar that is not there is where the vehicle's axes are
std::string calibration_text(const Sensor& sensor, const Rigid& lidar_to_vehicle)
{
    const Intrinsics& k = sensor.intrinsics;
    const Rigid projection = {k.fx, 0, k.cx - kKittiPixel, 0, 0, k.fy, k.cy - kKittiPixel, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    std::string text;
    for (int i = 0; i < 4; ++i)
        text += fmt::format("P{}: {}\n", i, rows_text(projection, 3));
    text += "R0_rect: 1 0 0 0 1 0 0 0 1\n";
    text +=
        fmt::format("Tr_velo_to_cam: {}\n", rows_text(compose(inverse(sensor.sensor_to_vehicle), lidar_to_vehicle), 3));
    return text + fmt::format("Tr_imu_to_velo: {}\n", rows_text(inverse(lidar_to_vehicle), 3));
}

class KittiExport {
  public:
    KittiExport(const Path& out, const ExportOptions& options) : out_(out), options_(options) {}

    Status add(const DriveInput& drive, size_t number, bool test)
    {
        const std::string camera = options_.camera.empty() ? drive.record.sensors[0].name : options_.camera;
        const Sensor* sensor = drive.record.sensor(camera);
        if (!sensor)
            return fail(ErrorCode::bad_input, "{} has no `camera` {}", quote_path(drive.folder), quote(camera));
        SR_CHECK(check_pinhole(*sensor, "KITTI"));
        CameraPath path;
        for (size_t i = 0; i < drive.path.frames.size(); ++i) {
            if (drive.path.frames[i].camera != camera)
                continue;
            path.frames.push_back(drive.path.frames[i]);
            path.frames.back().camera.clear();
            SR_CHECK(add_picture(drive, i, *sensor));
            (test ? test_ : train_) += fmt::format("{:06}\n", number_++);
        }
        const Path sequence = out_ / "sequences" / fmt::format("{:02}", number);
        SR_CHECK(make_folder(sequence));
        return write_kitti(sequence / "poses.txt", path);
    }
    Result<ExportReport> finish()
    {
        SR_CHECK(put_file(out_ / "ImageSets" / "train.txt", train_));
        SR_CHECK(put_file(out_ / "ImageSets" / "val.txt", test_));
        return std::move(report_);
    }

  private:
    Status add_picture(const DriveInput& drive, size_t picture, const Sensor& sensor)
    {
        const Path training = out_ / "training";
        const std::string name = fmt::format("{:06}", number_);
        SR_TRY(const auto color, color_file(drive, picture, false, options_.quality));
        SR_CHECK(put_file(training / "image_2" / (name + ".png"), color));
        SR_CHECK(
            put_file(training / "calib" / (name + ".txt"), calibration_text(sensor, drive.lidar.sensor_to_vehicle)));
        ++report_.pictures;
        if (drive.lidar.there()) {
            const DriveRecord::Moment* moment = drive.record.moment(drive.record.pictures[picture].time);
            const size_t scan = size_t(moment - drive.record.moments.data());
            SR_TRY(const auto points, read_scan(drive.lidar.scans[scan].points));
            SR_CHECK(put_file(training / "velodyne" / (name + ".bin"), scan_rows(points, [](const ScanPoint& p) {
                                  return std::array{p[0], p[1], p[2], p[3]};
                              })));
            ++report_.scans;
        }
        if (drive.boxes.empty())
            return {};
        std::string lines;
        for (const SeenObject& o : drive.boxes[picture].objects) {
            const char* type = kitti_type(o.label);
            if (type)
                lines += kitti_line(o, drive.path.frames[picture], type);
            ++(type ? report_.boxes : report_.left_out[label_name(o.label)]);
        }
        return put_file(training / "label_2" / (name + ".txt"), lines);
    }

    const Path& out_;
    const ExportOptions& options_;
    size_t number_ = 0;
    std::string train_, test_;
    ExportReport report_;
};

} // namespace

Result<ExportReport> export_kitti(std::span<const DriveInput> drives, const Path& out, const ExportOptions& options)
{
    KittiExport kitti(out, options);
    for (size_t i = 0; i < drives.size(); ++i)
        SR_CHECK(kitti.add(drives[i], i, i + options.val >= drives.size()));
    return kitti.finish();
}

} // namespace semrover
