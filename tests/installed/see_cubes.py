# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""What the sample hosts (tools/host) must show: sky, splats of the street, and cubes that stand among them.

see_cubes.py record FRAME.ppm FRAME.ppm    of record_host and gles_host: cubes where they are, hidden where a wall is before them
see_cubes.py window FRAME.ppm              of vulkan_host, after some flight: sky, street, and a cube
"""
import math
import sys

SKY = (158, 189, 219)
RED, GREEN, BLUE = (0.9, 0.1, 0.1), (0.1, 0.8, 0.2), (0.1, 0.2, 0.9)
X_FACE, Y_FACE = 0.8, 0.6  # how bright they are


class Picture:
    def __init__(self, path):
        with open(path, "rb") as file:
            head = file.readline().split()
            assert head[0] == b"P6" and head[3] == b"255", head
            self.width, self.height = int(head[1]), int(head[2])
            self.pixels = file.read()
        assert len(self.pixels) == 3 * self.width * self.height

    def at(self, x, y):
        i = 3 * (y * self.width + x)
        return tuple(self.pixels[i:i + 3])

    def share(self, color, x0, y0, x1, y1):
        """of the pixels of a rectangle that have a color, but for the last bit"""
        seen = [self.at(x, y) for y in range(y0, y1) for x in range(x0, x1)]
        assert seen, (x0, y0, x1, y1)
        return sum(same(pixel, color) for pixel in seen) / len(seen)


def same(a, b):
    return all(abs(p - q) <= 1 for p, q in zip(a, b))


def face(color, brightness):
    return tuple(round(255 * c * brightness) for c in color)


def project(picture, frame, point, yaw=0.1):
    """as scene_look() and cube.vert have it, and gles_host.c"""
    dx, dy, dz = point[0] - (1 + 0.5 * frame), point[1], point[2] - 1.7
    right = math.sin(yaw) * dx - math.cos(yaw) * dy
    forward = math.cos(yaw) * dx + math.sin(yaw) * dy
    focal = picture.width / 2
    return int(picture.width / 2 + focal * right / forward), int(picture.height / 2 - focal * dz / forward)


def box(picture, frame, low, high):
    """pixels of a rectangle of a face, between two of its corners"""
    (x0, y0), (x1, y1) = project(picture, frame, low), project(picture, frame, high)
    return min(x0, x1), min(y0, y1), max(x0, x1) + 1, max(y0, y1) + 1


def check_record(picture, frame):
    # the red cube stands before everything: its face towards the camera is whole
    assert picture.share(face(RED, X_FACE), *box(picture, frame, (8.5, 0.8, 0.8), (8.5, 1.6, 1.5))) == 1
    # the green one is sunk into the road: its top is seen, its foot is not
    green = face(GREEN, X_FACE)
    assert picture.share(green, *box(picture, frame, (6.4, -2.2, 0.85), (6.4, -1.4, 1.0))) > 0.9
    assert picture.share(green, *box(picture, frame, (6.4, -2.2, -0.1), (6.4, -1.4, 0.05))) < 0.1
    # the blue one overtops the wall and is hidden behind it
    blue = face(BLUE, Y_FACE)
    assert picture.share(blue, *box(picture, frame, (11.4, 5.7, 3.3), (12.6, 5.7, 3.8))) > 0.9
    assert picture.share(blue, *box(picture, frame, (11.4, 5.7, 0.7), (12.6, 5.7, 1.7))) < 0.1
    check_street(picture)


def check_street(picture):
    w, h = picture.width, picture.height
    assert picture.share(SKY, 0, 0, w, h // 8) > 0.9
    assert picture.share(SKY, 0, 3 * h // 4, w, h) < 0.2
    road = {picture.at(x, y) for y in range(3 * h // 4, h) for x in range(w)}
    assert len(road) > 500, len(road)  # many splats, not one color


def main(kind, *paths):
    pictures = [Picture(path) for path in paths]
    if kind == "record":
        for frame, picture in enumerate(pictures):
            check_record(picture, frame)
        assert pictures[0].pixels != pictures[1].pixels
        return
    for picture in pictures:
        check_street(picture)
        assert picture.share(face(RED, X_FACE), 0, 0, picture.width, picture.height) > 0.002


if __name__ == "__main__":
    main(*sys.argv[1:])
