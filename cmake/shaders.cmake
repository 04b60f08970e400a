# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0

# shaders/<op>[.<variant>].comp -> SPIR-V -> <build>/generated/<op>.spv.h, one header per op with all its variants;
# <build>/generated/catalogue.cpp lists them all for kernels/catalogue.h, its path is left in ${target}_catalogue
find_program(GLSLANG glslangValidator REQUIRED)
add_executable(reflect cmake/reflect/main.cpp cmake/reflect/module.cpp)
target_link_libraries(reflect PRIVATE fmt::fmt)

function(add_shader_headers target)
    file(GLOB shaders CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/shaders/*.comp)
    file(GLOB libraries CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/shaders/*.h ${CMAKE_SOURCE_DIR}/shaders/lib/*.glsl)
    set(generated ${CMAKE_BINARY_DIR}/generated)
    file(MAKE_DIRECTORY ${generated})
    set(ops)
    foreach(shader ${shaders})
        get_filename_component(file ${shader} NAME)
        string(REGEX REPLACE "\\.comp$" "" module ${file})
        string(REGEX REPLACE "\\..*$" "" op ${module})
        set(spirv ${generated}/${module}.spv)
        add_custom_command(OUTPUT ${spirv}
            COMMAND ${GLSLANG} -V --quiet --target-env vulkan1.2 -I${CMAKE_SOURCE_DIR}/shaders -o ${spirv} ${shader}
            DEPENDS ${shader} ${libraries} COMMENT "SPIR-V ${module}" VERBATIM)
        list(APPEND ops ${op})
        list(APPEND modules_${op} ${spirv})
    endforeach()
    list(REMOVE_DUPLICATES ops)
    set(headers)
    set(catalogue_includes)
    set(catalogue_entries)
    foreach(op ${ops})
        string(APPEND catalogue_includes "#include \"${op}.spv.h\"\n")
        string(APPEND catalogue_entries "        &kernel::${op},\n")
        set(header ${generated}/${op}.spv.h)
        add_custom_command(OUTPUT ${header} COMMAND reflect ${header} ${op} ${modules_${op}}
            DEPENDS reflect ${modules_${op}} COMMENT "reflect ${op}" VERBATIM)
        list(APPEND headers ${header})
    endforeach()
    configure_file(${CMAKE_SOURCE_DIR}/cmake/catalogue.cpp.in ${generated}/catalogue.cpp @ONLY)
    set(${target}_catalogue ${generated}/catalogue.cpp PARENT_SCOPE)
    add_custom_target(${target}_headers DEPENDS ${headers})
    add_library(${target} INTERFACE)
    add_dependencies(${target} ${target}_headers)
    target_include_directories(${target} INTERFACE ${generated})
endfunction()
