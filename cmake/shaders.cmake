# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0

# <folder>/<op>[.<variant>].comp -> SPIR-V -> <build>/generated/<op>.spv.h, one header per op with all its variants.
# Compilers before version 14, such as Debian 12's, do not know cooperative matrices: for them SPIR-V of .coopmat variants
# lies in shaders/spirv (tools/dev/spirv)
find_program(GLSLANG glslangValidator REQUIRED)
execute_process(COMMAND ${GLSLANG} --version OUTPUT_VARIABLE glslang_version)
set(knows_coopmat FALSE)
if(glslang_version MATCHES "Glslang Version: [0-9]+:([0-9]+)" AND CMAKE_MATCH_1 GREATER_EQUAL 14)
    set(knows_coopmat TRUE)
endif()
set(reflect_sources cmake/reflect/main.cpp cmake/reflect/module.cpp cmake/reflect/protocol.cpp)
list(TRANSFORM reflect_sources PREPEND ${CMAKE_SOURCE_DIR}/)
if(CMAKE_CROSSCOMPILING) # it runs here
    set(reflect ${CMAKE_BINARY_DIR}/reflect)
    add_custom_command(OUTPUT ${reflect} DEPENDS ${reflect_sources} VERBATIM
        COMMAND c++ -std=c++20 -O1 -I${CMAKE_SOURCE_DIR} -o ${reflect} ${reflect_sources} -lfmt)
else()
    set(reflect reflect)
    add_executable(reflect ${reflect_sources})
    target_include_directories(reflect PRIVATE ${CMAKE_SOURCE_DIR})
    target_link_libraries(reflect PRIVATE fmt::fmt)
    target_compile_options(reflect PRIVATE "${cold_options}")
endif()

# add_shader_headers(TARGET FOLDER...): an interface target with the headers of the ops in these folders; their names are
# left in TARGET_ops
function(add_shader_headers target)
    set(shaders)
    foreach(folder ${ARGN})
        file(GLOB of_folder CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/${folder}/*.comp)
        list(APPEND shaders ${of_folder})
    endforeach()
    file(GLOB_RECURSE libraries CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/shaders/*.h ${CMAKE_SOURCE_DIR}/shaders/lib/*.glsl)
    set(generated ${CMAKE_BINARY_DIR}/generated)
    file(MAKE_DIRECTORY ${generated})
    set(ops)
    foreach(shader ${shaders})
        get_filename_component(file ${shader} NAME)
        string(REGEX REPLACE "\\.comp$" "" module ${file})
        string(REGEX REPLACE "\\..*$" "" op ${module})
        list(APPEND ops ${op})
        if(module MATCHES "\\.coopmat$" AND NOT knows_coopmat)
            list(APPEND modules_${op} ${CMAKE_SOURCE_DIR}/shaders/spirv/${module}.spv)
            continue()
        endif()
        set(spirv ${generated}/${module}.spv)
        add_custom_command(OUTPUT ${spirv}
            COMMAND ${GLSLANG} -V --quiet --target-env vulkan1.2 -I${CMAKE_SOURCE_DIR}/shaders -I${CMAKE_SOURCE_DIR}
                    -o ${spirv} ${shader}
            DEPENDS ${shader} ${libraries} COMMENT "SPIR-V ${module}" VERBATIM)
        list(APPEND modules_${op} ${spirv})
    endforeach()
    list(REMOVE_DUPLICATES ops)
    set(headers)
    foreach(op ${ops})
        set(header ${generated}/${op}.spv.h)
        add_custom_command(OUTPUT ${header} COMMAND ${reflect} ${header} ${op} ${modules_${op}}
            DEPENDS ${reflect} ${modules_${op}} COMMENT "reflect ${op}" VERBATIM)
        list(APPEND headers ${header})
    endforeach()
    set(${target}_ops ${ops} PARENT_SCOPE)
    add_custom_target(${target}_headers DEPENDS ${headers})
    add_library(${target} INTERFACE)
    add_dependencies(${target} ${target}_headers)
    target_include_directories(${target} INTERFACE ${generated})
endfunction()

# add_kernel_registry(TARGET HEADERS...): a library that lists the ops of these header targets, for kernels/kernel_registry.h
function(add_kernel_registry target)
    set(registry_includes)
    set(registry_entries)
    foreach(headers ${ARGN})
        foreach(op ${${headers}_ops})
            string(APPEND registry_includes "#include \"${op}.spv.h\"\n")
            string(APPEND registry_entries "        &kernel::${op},\n")
        endforeach()
    endforeach()
    configure_file(${CMAKE_SOURCE_DIR}/cmake/kernel_registry.cpp.in ${CMAKE_BINARY_DIR}/generated/kernel_registry.cpp @ONLY)
    add_library(${target} STATIC ${CMAKE_BINARY_DIR}/generated/kernel_registry.cpp)
    target_link_libraries(${target} PUBLIC semrover_runtime PRIVATE ${ARGN})
endfunction()
