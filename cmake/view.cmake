# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0

# semrover-view, where GLFW and Dear ImGui are installed (tools/setup --view). It stands on libsemrover.so as a host
# does, and shares with the other programs how options are read.
find_package(glfw3 3.3 QUIET)
pkg_check_modules(IMGUI QUIET IMPORTED_TARGET imgui)
if(NOT glfw3_FOUND OR NOT IMGUI_FOUND)
    message(STATUS "No semrover-view: GLFW or Dear ImGui is not installed (tools/setup --view)")
    return()
endif()

# <build>/generated/picture.{vert,frag}.inc: SPIR-V as numbers, to be included into an array
set(view_shaders)
foreach(shader picture.vert picture.frag)
    set(made ${CMAKE_BINARY_DIR}/generated/${shader}.inc)
    add_custom_command(OUTPUT ${made} DEPENDS ${CMAKE_SOURCE_DIR}/tools/view/${shader}
        COMMAND ${GLSLANG} -V -x --quiet --target-env vulkan1.2 -o ${made} ${CMAKE_SOURCE_DIR}/tools/view/${shader}
        COMMENT "SPIR-V ${shader}" VERBATIM)
    list(APPEND view_shaders ${made})
endforeach()

add_program(semrover-view SOURCES tools/view/*.cpp LIBRARIES semrover_c PNG::PNG glfw)
target_sources(semrover-view PRIVATE ${view_shaders})
target_include_directories(semrover-view PRIVATE ${CMAKE_BINARY_DIR}/generated)
target_include_directories(semrover-view SYSTEM PRIVATE ${IMGUI_INCLUDE_DIRS})
target_link_libraries(semrover-view PRIVATE ${IMGUI_LINK_LIBRARIES} Vulkan::Vulkan)
set_target_properties(semrover-view PROPERTIES BUILD_RPATH "$ORIGIN")
add_dependencies(programs semrover-view)
