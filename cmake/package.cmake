# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
# `cpack` in a build folder where everything is built: an archive to unpack anywhere, with the programs, the library,
# headers, sample hosts, the Python package and the default model. -G DEB: Debian's packages of these, without the model.
set(CPACK_PACKAGE_NAME semrover)
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_PACKAGE_CONTACT "semrover authors")
set(CPACK_STRIP_FILES ON)
set(CPACK_COMPONENTS_GROUPING ALL_COMPONENTS_IN_ONE)
set(CPACK_ARCHIVE_COMPONENT_INSTALL ON)
set(CPACK_COMPONENT_INCLUDE_TOPLEVEL_DIRECTORY ON)
set(CPACK_COMPONENTS_ALL library archive)

set(packed_programs semrover semrover-eval semrover-scenes)
if(TARGET semrover-view)
    list(APPEND packed_programs semrover-view)
    set_target_properties(semrover-view PROPERTIES INSTALL_RPATH "$ORIGIN/../lib")
endif()
install(TARGETS ${packed_programs} DESTINATION bin COMPONENT archive EXCLUDE_FROM_ALL)
install(DIRECTORY assets/model DESTINATION share/semrover COMPONENT archive EXCLUDE_FROM_ALL)
install(FILES assets/scenes/street.semantic.sgrid assets/scenes/street.tum DESTINATION share/semrover COMPONENT archive EXCLUDE_FROM_ALL)
install(DIRECTORY tools/python/semrover tools/python/examples DESTINATION share/semrover/python
    COMPONENT archive EXCLUDE_FROM_ALL PATTERN "__pycache__" EXCLUDE)
install(FILES LICENSE DESTINATION . COMPONENT archive EXCLUDE_FROM_ALL)
if(WIN32)
    set(CPACK_GENERATOR ZIP)
    set(CPACK_SYSTEM_NAME windows-x86_64)
    include(CPack)
    return()
endif()
set(CPACK_GENERATOR TGZ)
set(CPACK_SYSTEM_NAME linux-${CMAKE_SYSTEM_PROCESSOR})
set(CPACK_PROJECT_CONFIG_FILE ${CMAKE_CURRENT_SOURCE_DIR}/cmake/package_debian.cmake)

# ---- Debian's: places below /usr
set(debian_libdir lib/${CMAKE_LIBRARY_ARCHITECTURE})
set(debian_cmake ${debian_libdir}/cmake/semrover)

install(TARGETS ${packed_programs} DESTINATION bin COMPONENT deb_program EXCLUDE_FROM_ALL)
install(DIRECTORY tools/cluster DESTINATION share/semrover USE_SOURCE_PERMISSIONS
    COMPONENT deb_program EXCLUDE_FROM_ALL)

install(TARGETS semrover_c EXPORT semrover_debian LIBRARY DESTINATION ${debian_libdir}
    COMPONENT deb_library NAMELINK_COMPONENT deb_development EXCLUDE_FROM_ALL)
file(GLOB debian_headers CONFIGURE_DEPENDS engine/semrover*.h)
install(FILES ${debian_headers} DESTINATION include COMPONENT deb_development EXCLUDE_FROM_ALL)
install(DIRECTORY tools/host DESTINATION share/semrover COMPONENT deb_development EXCLUDE_FROM_ALL)
install(EXPORT semrover_debian NAMESPACE semrover:: FILE semroverConfig.cmake DESTINATION ${debian_cmake}
    COMPONENT deb_development EXCLUDE_FROM_ALL)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/semroverConfigVersion.cmake DESTINATION ${debian_cmake}
    COMPONENT deb_development EXCLUDE_FROM_ALL)
write_pkgconfig(debian/semrover.pc ${debian_libdir})
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/debian/semrover.pc DESTINATION ${debian_libdir}/pkgconfig
    COMPONENT deb_development EXCLUDE_FROM_ALL)
install(DIRECTORY tools/python/semrover DESTINATION lib/python3/dist-packages COMPONENT deb_python EXCLUDE_FROM_ALL
    PATTERN "__pycache__" EXCLUDE)
install(DIRECTORY tools/python/examples DESTINATION share/doc/python3-semrover COMPONENT deb_python EXCLUDE_FROM_ALL)
foreach(package "program;semrover" "library;libsemrover0" "development;libsemrover-dev" "python;python3-semrover")
    list(GET package 0 component)
    list(GET package 1 name)
    install(FILES LICENSE DESTINATION share/doc/${name} RENAME copyright COMPONENT deb_${component} EXCLUDE_FROM_ALL)
    string(TOUPPER DEB_${component} variable)
    set(CPACK_DEBIAN_${variable}_PACKAGE_NAME ${name})
    set(CPACK_DEBIAN_${variable}_FILE_NAME DEB-DEFAULT)
endforeach()

set(CPACK_DEB_COMPONENT_INSTALL ON)

set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS ${CMAKE_BINARY_DIR}) # where libsemrover.so is
set(CPACK_DEBIAN_DEB_LIBRARY_PACKAGE_GENERATE_SHLIBS ON)
set(CPACK_DEBIAN_DEB_LIBRARY_PACKAGE_SECTION libs)
set(CPACK_DEBIAN_DEB_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEB_DEVELOPMENT_PACKAGE_DEPENDS "libsemrover0 (= ${PROJECT_VERSION})")
set(CPACK_DEBIAN_DEB_DEVELOPMENT_PACKAGE_SUGGESTS libvulkan-dev) # semrover_vulkan.h includes vulkan_core.h
set(CPACK_DEBIAN_DEB_PYTHON_PACKAGE_SECTION python)
set(CPACK_DEBIAN_DEB_PYTHON_PACKAGE_ARCHITECTURE all)
set(CPACK_DEBIAN_DEB_PYTHON_PACKAGE_DEPENDS "libsemrover0 (= ${PROJECT_VERSION}), python3, python3-numpy")
set(CPACK_DEBIAN_DEB_PYTHON_PACKAGE_SUGGESTS "python3-pil, python3-torch")
set(CPACK_DEBIAN_DEB_PROGRAM_PACKAGE_SECTION graphics)
if(TARGET semrover-view)
    set(CPACK_DEBIAN_DEB_PROGRAM_PACKAGE_DEPENDS "libsemrover0 (= ${PROJECT_VERSION})")
endif()
set(CPACK_DEBIAN_DEB_PROGRAM_PACKAGE_RECOMMENDS mesa-vulkan-drivers)
set(CPACK_DEBIAN_DEB_PROGRAM_PACKAGE_SUGGESTS ffmpeg)
set(CPACK_COMPONENT_DEB_PROGRAM_DESCRIPTION "coloured 3D streets from semantic voxel grids
Turns labelled voxels into coloured points, draws them as splats along camera
paths, and refines the frames, on any Vulkan 1.2 device.")
set(CPACK_COMPONENT_DEB_LIBRARY_DESCRIPTION "streets that are generated around a camera: shared library
Turns labelled voxels into coloured points and splats inside a host program,
on any Vulkan 1.2 device.")
set(CPACK_COMPONENT_DEB_DEVELOPMENT_DESCRIPTION "streets that are generated around a camera: development files
Header, CMake and pkg-config files of libsemrover, and sample hosts.")
set(CPACK_COMPONENT_DEB_PYTHON_DESCRIPTION "streets that are generated around a camera: Python
The interface of libsemrover as numpy arrays, and readers of drives on disk.")
include(CPack)
