# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
# Written by tools/python/generate.py of the C headers; not to be edited.
from ctypes import (CFUNCTYPE, POINTER, c_char, c_char_p, c_double, c_float, c_int32, c_int64, c_size_t, c_uint8, c_uint16,
                    c_uint32, c_uint64, c_void_p)

from ._numbers import Structure

SR_VERSION = 100
SR_ABI_VERSION = 0
SR_NO_CELL = 0xffffffff
SR_CLASSES = 20
SR_MODEL_VOXFIELD = 1
SR_MODEL_RENDERER = 2
SR_FP16 = 0
SR_FP32 = 1
SR_CONDITION_OBJECTS = 1
SR_CONDITION_COLORS = 2
SR_CONDITION_PARTS = 4
SR_SAMPLER_DDPM = 0
SR_SAMPLER_DDIM = 1
SR_SAMPLER_DPMPP_2M = 2
SR_KNOWN_NOISED = 0
SR_KNOWN_CLEAN = 1
SR_REGIONS_COMPLETE = 0
SR_REGIONS_RIM = 1
SR_CONDITIONING_GUESSED = 0
SR_CONDITIONING_NONE = 1
SR_CONDITIONING_GIVEN = 2
SR_OK = 0
SR_ERR_USAGE = 2
SR_ERR_BAD_INPUT = 3
SR_ERR_NO_DEVICE = 4
SR_ERR_OUT_OF_MEMORY = 5
SR_ERR_DEVICE_LOST = 6
SR_ERR_PARTIAL = 7
SR_NOT_YET = 8
SR_ERR_INTERNAL = 70
SR_ERR_INTERRUPTED = 130
SR_STATUS_IS_32_BIT = 0x7fffffff
SR_CAMERA_PINHOLE = 0
SR_CAMERA_OPENCV = 1
SR_CAMERA_FISHEYE = 2
SR_CAMERA_EQUIRECTANGULAR = 3
SR_CAMERA_FTHETA = 4
SR_SHUTTER_GLOBAL = 0
SR_SHUTTER_DOWN = 1
SR_SHUTTER_UP = 2
SR_SHUTTER_RIGHT = 3
SR_SHUTTER_LEFT = 4
SR_FLOW_NOTHING = 0
SR_FLOW_SEEN = 1
SR_FLOW_HIDDEN = 2
SR_FLOW_OUTSIDE = 3
SR_NOISE_OF_MODEL = 0
SR_NOISE_FRESH = 1
SR_NOISE_ON_SURFACES = 2


class sr_device_info(Structure):
    _fields_ = [("struct_size", c_uint32),
                ("index", c_uint32),
                ("name", c_char * 256),
                ("driver", c_char * 256),
                ("refusal", c_char * 256),
                ("type", c_char * 16),
                ("api", c_char * 16),
                ("memory_bytes", c_uint64)]


class sr_context_desc(Structure):
    _fields_ = [("struct_size", c_uint32),
                ("validation", c_uint32),
                ("next", c_void_p),
                ("device", c_char_p),
                ("vulkan", c_void_p),
                ("max_bytes", c_uint64),
                ("pipeline_cache", c_void_p),
                ("pipeline_cache_bytes", c_uint64),
                ("allocation_callbacks", c_void_p),
                ("share_by_fd", c_uint32),
                ("reserved", c_uint32)]


class sr_memory_info(Structure):
    _fields_ = [("struct_size", c_uint32),
                ("reserved", c_uint32),
                ("used_bytes", c_uint64),
                ("peak_bytes", c_uint64),
                ("budget_bytes", c_uint64)]


class sr_cell(Structure):
    _fields_ = [("i", c_int32),
                ("j", c_int32),
                ("k", c_int32),
                ("label", c_uint32)]


class sr_grid_info(Structure):
    _fields_ = [("struct_size", c_uint32),
                ("points_per_voxel", c_uint32),
                ("cells", c_uint64),
                ("voxel_size", c_double)]


class sr_file(Structure):
    _fields_ = [("path", c_char_p),
                ("data", c_void_p),
                ("bytes", c_uint64)]


class sr_model_desc(Structure):
    _fields_ = [("struct_size", c_uint32),
                ("parts", c_uint32),
                ("next", c_void_p),
                ("path", c_char_p),
                ("files", POINTER(sr_file)),
                ("file_count", c_uint64),
                ("precision", c_uint32),
                ("reserved", c_uint32),
                ("progress", CFUNCTYPE(c_uint32, c_void_p, c_uint64, c_uint64)),
                ("user", c_void_p),
                ("preset", c_char_p)]


class sr_model_info(Structure):
    _fields_ = [("struct_size", c_uint32),
                ("parts", c_uint32),
                ("precision", c_uint32),
                ("conditions", c_uint32),
                ("device_bytes", c_uint64),
                ("voxel_size", c_double),
                ("points_per_voxel", c_uint32),
                ("steps", c_uint32),
                ("renderer_steps", c_uint32),
                ("window_frames", c_uint32),
                ("splat_radius", c_double)]


class sr_generation(Structure):
    _fields_ = [("struct_size", c_uint32),
                ("sampler", c_uint32),
                ("known", c_uint32),
                ("regions", c_uint32),
                ("region_size", c_uint32),
                ("least_uncovered", c_uint32),
                ("jump_length", c_uint32),
                ("jump_count", c_uint32),
                ("guidance_from", c_uint32),
                ("guidance_until", c_uint32),
                ("eta", c_double),
                ("guidance_scale", c_double),
                ("guidance_radius", c_double)]


class sr_object(Structure):
    _fields_ = [("id", c_uint32),
                ("label", c_uint32),
                ("center", c_double * 3),
                ("size", c_double * 3),
                ("heading", c_double),
                ("color", c_float * 3),
                ("colored", c_uint32),
                ("part", c_uint32),
                ("reserved", c_uint32)]


class sr_cell_rect(Structure):
    _fields_ = [("low", c_int32 * 2),
                ("high", c_int32 * 2)]


class sr_world_desc(Structure):
    _fields_ = [("struct_size", c_uint32),
                ("steps", c_uint32),
                ("next", c_void_p),
                ("model", c_void_p),
                ("grid", c_void_p),
                ("folder", c_char_p),
                ("labels", CFUNCTYPE(c_int32, c_void_p, POINTER(sr_cell_rect), c_void_p)),
                ("message", CFUNCTYPE(None, c_void_p, c_char_p)),
                ("user", c_void_p),
                ("cache", c_char_p),
                ("generation", POINTER(sr_generation)),
                ("objects", POINTER(sr_object)),
                ("object_count", c_uint64),
                ("seed", c_uint64),
                ("host_bytes", c_uint64),
                ("splat_bytes", c_uint64),
                ("tile_size", c_double),
                ("splat_radius", c_double),
                ("tiles_at_once", c_uint32),
                ("conditioning", c_uint32),
                ("detail_distance", c_double),
                ("portable_cache", c_uint32),
                ("reserved", c_uint32)]


class sr_focus(Structure):
    _fields_ = [("position", c_double * 3),
                ("direction", c_double * 3),
                ("radius", c_double)]


class sr_world_info(Structure):
    _fields_ = [("struct_size", c_uint32),
                ("full", c_uint32),
                ("wanted", c_uint64),
                ("finished", c_uint64),
                ("in_memory", c_uint64),
                ("host_bytes", c_uint64),
                ("generated", c_uint64),
                ("loaded", c_uint64),
                ("dropped", c_uint64),
                ("splats", c_uint64),
                ("voxel_size", c_double),
                ("tile_cells", c_uint32),
                ("points_per_voxel", c_uint32)]


class sr_target(Structure):
    _fields_ = [("memory", c_void_p),
                ("buffer", c_void_p),
                ("buffer_offset", c_uint64),
                ("image", c_void_p),
                ("layout_before", c_uint32),
                ("layout_after", c_uint32),
                ("format", c_uint32),
                ("reserved", c_uint32)]


class sr_depth_image(Structure):
    _fields_ = [("image", c_void_p),
                ("format", c_uint32),
                ("layout_before", c_uint32),
                ("layout_after", c_uint32),
                ("reserved", c_uint32),
                ("scale", c_double),
                ("offset", c_double)]


class sr_draw_desc(Structure):
    _fields_ = [("struct_size", c_uint32),
                ("width", c_uint32),
                ("next", c_void_p),
                ("height", c_uint32),
                ("color_linear", c_uint32),
                ("fx", c_double),
                ("fy", c_double),
                ("cx", c_double),
                ("cy", c_double),
                ("world_to_camera", c_double * 12),
                ("color", sr_target),
                ("normal", sr_target),
                ("depth", sr_target),
                ("label", sr_target),
                ("depth_test", sr_depth_image),
                ("depth_scale", c_double),
                ("depth_offset", c_double),
                ("instance", sr_target),
                ("time", c_double),
                ("camera_model", c_uint32),
                ("shutter", c_uint32),
                ("distortion", c_double * 12),
                ("world_to_camera_start", c_double * 12),
                ("world_to_camera_end", c_double * 12),
                ("readout_start", c_double),
                ("readout_end", c_double)]


class sr_actor_pose(Structure):
    _fields_ = [("time_us", c_int64),
                ("pose", c_double * 12)]


class sr_actor(Structure):
    _fields_ = [("object", c_uint32),
                ("pose_count", c_uint32),
                ("poses", POINTER(sr_actor_pose))]


class sr_pick(Structure):
    _fields_ = [("struct_size", c_uint32),
                ("instance", c_uint32),
                ("cell", sr_cell),
                ("position", c_double * 3),
                ("alpha", c_double)]


class sr_sweep_desc(Structure):
    _fields_ = [("struct_size", c_uint32),
                ("reserved", c_uint32),
                ("next", c_void_p),
                ("lidar", c_char_p),
                ("sensor_to_world_begin", c_double * 12),
                ("sensor_to_world_end", c_double * 12),
                ("time", c_double),
                ("least_alpha", c_double)]


class sr_lidar_return(Structure):
    _fields_ = [("x", c_float),
                ("y", c_float),
                ("z", c_float),
                ("intensity", c_float),
                ("ring", c_uint32),
                ("label", c_uint32),
                ("instance", c_uint32),
                ("time_us", c_uint32)]


class sr_renderer_desc(Structure):
    _fields_ = [("struct_size", c_uint32),
                ("steps", c_uint32),
                ("next", c_void_p),
                ("model", c_void_p),
                ("width", c_uint32),
                ("height", c_uint32),
                ("seed", c_uint64),
                ("camera", c_char_p),
                ("noise", c_uint32),
                ("reserved", c_uint32),
                ("message", CFUNCTYPE(None, c_void_p, c_char_p)),
                ("user", c_void_p)]


class sr_source(Structure):
    _fields_ = [("memory", c_void_p),
                ("buffer", c_void_p),
                ("buffer_offset", c_uint64)]


class sr_frame_desc(Structure):
    _fields_ = [("struct_size", c_uint32),
                ("reserved", c_uint32),
                ("next", c_void_p),
                ("world", c_void_p),
                ("seen", sr_source),
                ("depth", sr_source),
                ("fx", c_double),
                ("fy", c_double),
                ("cx", c_double),
                ("cy", c_double),
                ("world_to_camera", c_double * 12),
                ("time", c_double)]


class sr_renderer_info(Structure):
    _fields_ = [("struct_size", c_uint32),
                ("steps", c_uint32),
                ("frames", c_uint32),
                ("noise", c_uint32),
                ("busy", c_uint32),
                ("resident", c_uint32),
                ("device_bytes", c_uint64),
                ("splat_radius", c_double),
                ("visible_alpha", c_float),
                ("reserved", c_float)]


# name: (result, parameters)
FUNCTIONS = {
    "sr_abi_version": (c_uint32, []),
    "sr_version": (c_char_p, []),
    "sr_status_name": (c_char_p, [c_int32]),
    "sr_last_error": (c_size_t, [c_void_p, c_char_p, c_size_t]),
    "sr_set_diagnostic_callback": (None, [CFUNCTYPE(None, c_void_p, c_char_p), c_void_p]),
    "sr_list_devices": (c_int32, [POINTER(sr_device_info), POINTER(c_uint32)]),
    "sr_context_create": (c_int32, [POINTER(sr_context_desc), POINTER(c_void_p)]),
    "sr_context_destroy": (None, [c_void_p]),
    "sr_context_get_device": (c_int32, [c_void_p, POINTER(sr_device_info)]),
    "sr_context_get_memory": (c_int32, [c_void_p, POINTER(sr_memory_info)]),
    "sr_context_get_pipeline_cache": (c_int32, [c_void_p, c_void_p, POINTER(c_uint64)]),
    "sr_class_name": (c_char_p, [c_uint32]),
    "sr_class_color": (c_int32, [c_uint32, POINTER(c_uint8)]),
    "sr_grid_create": (c_int32, [c_double, POINTER(c_void_p)]),
    "sr_grid_read": (c_int32, [c_char_p, POINTER(c_void_p)]),
    "sr_grid_destroy": (None, [c_void_p]),
    "sr_grid_write": (c_int32, [c_void_p, c_char_p]),
    "sr_grid_get_info": (c_int32, [c_void_p, POINTER(sr_grid_info)]),
    "sr_grid_set_cells": (c_int32, [c_void_p, POINTER(sr_cell), c_uint64]),
    "sr_grid_get_cells": (c_int32, [c_void_p, c_uint64, c_uint64, POINTER(sr_cell), POINTER(c_uint64)]),
    "sr_grid_get_points": (c_int32, [c_void_p, c_uint64, c_uint64, POINTER(c_float), POINTER(c_uint64)]),
    "sr_model_load": (c_int32, [c_void_p, POINTER(sr_model_desc), POINTER(c_void_p)]),
    "sr_model_destroy": (None, [c_void_p]),
    "sr_model_get_info": (c_int32, [c_void_p, POINTER(sr_model_info)]),
    "sr_model_get_generation": (c_int32, [c_void_p, POINTER(sr_generation)]),
    "sr_read_objects": (c_int32, [c_char_p, POINTER(sr_object), POINTER(c_uint64)]),
    "sr_world_create": (c_int32, [c_void_p, POINTER(sr_world_desc), POINTER(c_void_p)]),
    "sr_world_destroy": (None, [c_void_p]),
    "sr_world_focus": (c_int32, [c_void_p, POINTER(c_double), POINTER(c_double), c_double]),
    "sr_world_foci": (c_int32, [c_void_p, POINTER(sr_focus), c_uint32]),
    "sr_world_step": (c_int32, [c_void_p, c_uint64, POINTER(c_uint32)]),
    "sr_world_edit": (c_int32, [c_void_p, POINTER(sr_cell), c_uint64]),
    "sr_world_labels_ready": (c_int32, [c_void_p, POINTER(sr_cell_rect)]),
    "sr_world_get_info": (c_int32, [c_void_p, POINTER(sr_world_info)]),
    "sr_world_copy_cells": (c_int32, [c_void_p, POINTER(sr_cell_rect), POINTER(c_void_p)]),
    "sr_world_flush": (c_int32, [c_void_p]),
    "sr_world_draw": (c_int32, [c_void_p, POINTER(sr_draw_desc)]),
    "sr_world_draws": (c_int32, [c_void_p, POINTER(sr_draw_desc), c_uint32]),
    "sr_world_set_actors": (c_int32, [c_void_p, POINTER(sr_actor), c_uint32]),
    "sr_world_pick": (c_int32, [c_void_p, POINTER(sr_draw_desc), c_uint32, c_uint32, POINTER(sr_pick)]),
    "sr_world_flow": (c_int32, [c_void_p, POINTER(sr_draw_desc), POINTER(sr_draw_desc), POINTER(sr_target), POINTER(sr_target)]),
    "sr_world_sweep": (c_int32, [c_void_p, POINTER(sr_sweep_desc), POINTER(sr_lidar_return), POINTER(c_uint64)]),
    "sr_renderer_create": (c_int32, [c_void_p, POINTER(sr_renderer_desc), POINTER(c_void_p)]),
    "sr_renderer_destroy": (None, [c_void_p]),
    "sr_renderer_begin": (c_int32, [c_void_p, POINTER(sr_frame_desc)]),
    "sr_renderer_step": (c_int32, [c_void_p, c_uint64, POINTER(c_uint32)]),
    "sr_renderer_take": (c_int32, [c_void_p, POINTER(sr_target)]),
    "sr_renderer_cancel": (c_int32, [c_void_p]),
    "sr_renderer_restart": (c_int32, [c_void_p]),
    "sr_renderer_get_info": (c_int32, [c_void_p, POINTER(sr_renderer_info)]),
}
