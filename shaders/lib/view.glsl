// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// the camera and the light of a picture, as ViewTable of kernels/trace.h has them: View is vec4[8]
vec3 view_axis(uint row) { return view[1 + row].xyz; } // x, y, z of the camera in the world: OpenCV axes
vec3 view_origin() { return vec3(view[1].w, view[2].w, view[3].w); }
vec3 sun_direction() { return view[4].xyz; } // towards the sun
float sun_width() { return view[4].w; }      // radius of the disc as a tangent
vec3 sun_light() { return view[5].xyz; }     // irradiance across the sun's direction
float cloud_cover() { return view[5].w; }    // 0..1
float exposure() { return view[6].x; }
float sky_level() { return view[6].y; }
float cloud_seed() { return view[6].z; }
float haze_distance() { return view[6].w; }

// direction of a pixel, not normalised: depth along the axis is 1
vec3 pixel_direction(vec2 pixel)
{
    const vec4 lens = view[0]; // fx, fy, cx, cy
    return (pixel.x - lens.z) / lens.x * view_axis(0) + (pixel.y - lens.w) / lens.y * view_axis(1) + view_axis(2);
}
