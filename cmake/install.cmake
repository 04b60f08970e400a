# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
# `cmake --install BUILD --prefix DIR --component library`: libsemrover.so, semrover.h, what tells CMake
# (find_package(semrover)) and pkg-config of them, and sample hosts to build against them (share/semrover/host)
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set_target_properties(semrover_c PROPERTIES EXPORT_NAME semrover)
target_include_directories(semrover_c INTERFACE $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
install(TARGETS semrover_c EXPORT semrover COMPONENT library
    LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT library NAMELINK_COMPONENT library)
install(DIRECTORY tools/host DESTINATION ${CMAKE_INSTALL_DATADIR}/semrover COMPONENT library)
install(FILES engine/semrover.h DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT library)
set(semrover_cmake_folder ${CMAKE_INSTALL_LIBDIR}/cmake/semrover)
install(EXPORT semrover NAMESPACE semrover:: FILE semroverConfig.cmake DESTINATION ${semrover_cmake_folder}
    COMPONENT library)
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/semroverConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/semroverConfigVersion.cmake DESTINATION ${semrover_cmake_folder}
    COMPONENT library)
# the prefix is told from where the file lies, so that the tree may be moved
file(RELATIVE_PATH up /${CMAKE_INSTALL_LIBDIR}/pkgconfig /)
file(CONFIGURE OUTPUT semrover.pc @ONLY CONTENT
"prefix=\${pcfiledir}/@up@
Name: semrover
Description: streets of coloured points from labels, on any Vulkan device
Version: @PROJECT_VERSION@
Cflags: -I\${prefix}/@CMAKE_INSTALL_INCLUDEDIR@
Libs: -L\${pcfiledir}/.. -lsemrover
")
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/semrover.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT library)
