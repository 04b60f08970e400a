# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
# read by cpack, which knows the generator
if(CPACK_GENERATOR STREQUAL DEB)
    set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
    set(CPACK_COMPONENTS_GROUPING IGNORE)
    set(CPACK_COMPONENT_INCLUDE_TOPLEVEL_DIRECTORY OFF)
    set(CPACK_COMPONENTS_ALL deb_program deb_library deb_development deb_python)
endif()
