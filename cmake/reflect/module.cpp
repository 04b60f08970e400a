// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// reads a compute module by the SPIR-V specification 1.5: names, decorations, types, variables, constants
#include "module.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <stdexcept>

namespace {

enum Op : uint16_t {
    kOpName = 5,
    kOpMemberName = 6,
    kOpExecutionMode = 16,
    kOpCapability = 17,
    kOpTypeInt = 21,
    kOpTypeFloat = 22,
    kOpTypeVector = 23,
    kOpTypeImage = 25,
    kOpTypeSampledImage = 27,
    kOpTypeArray = 28,
    kOpTypeStruct = 30,
    kOpTypePointer = 32,
    kOpConstant = 43,
    kOpSpecConstantTrue = 48,
    kOpSpecConstantFalse = 49,
    kOpSpecConstant = 50,
    kOpSpecConstantComposite = 51,
    kOpSpecConstantOp = 52,
    kOpVariable = 59,
    kOpSRem = 138,
    kOpSMod = 139,
    kOpTypeCooperativeMatrix = 4456,
    kOpDecorate = 71,
    kOpMemberDecorate = 72,
};
enum Decoration : uint32_t {
    kSpecId = 1,
    kBuiltIn = 11,
    kNonWritable = 24,
    kNonReadable = 25,
    kBinding = 33,
    kOffset = 35
};
enum Storage : uint32_t { kUniformConstant = 0, kWorkgroup = 4, kPushConstant = 9, kStorageBuffer = 12 };

struct Id {
    uint16_t op = 0;
    std::string name;
    std::vector<uint32_t> operands; // of the defining instruction, result ids left out
    std::vector<std::string> member_names;
    std::map<uint32_t, uint32_t> member_offsets;
    bool binding_set = false, spec_set = false, non_writable = false, non_readable = false, is_workgroup_size = false;
    uint32_t binding = 0, spec_id = 0;
};

std::string text(const uint32_t* words, size_t count)
{
    const char* s = reinterpret_cast<const char*>(words);
    return std::string(s, strnlen(s, count * 4));
}

class Reader {
  public:
    explicit Reader(std::vector<uint32_t> code) { module_.code = std::move(code); }

    Module run()
    {
        const auto& code = module_.code;
        if (code.size() < 5 || code[0] != 0x07230203u)
            throw std::runtime_error("not a SPIR-V module");
        ids_.resize(code[3]);
        for (size_t at = 5; at < code.size(); at += code[at] >> 16) {
            if (code[at] >> 16 == 0)
                throw std::runtime_error("zero-length instruction");
            instruction(uint16_t(code[at] & 0xffff), &code[at + 1], (code[at] >> 16) - 1);
        }
        constants();
        workgroup_size();
        for (uint32_t v : variables_)
            variable(ids_[v]);
        std::sort(module_.bindings.begin(), module_.bindings.end(),
                  [](const Binding& a, const Binding& b) { return a.binding < b.binding; });
        return std::move(module_);
    }

  private:
    void instruction(uint16_t op, const uint32_t* w, size_t n)
    {
        switch (op) {
        case kOpName:
            ids_[w[0]].name = text(w + 1, n - 1);
            break;
        case kOpMemberName: {
            auto& names = ids_[w[0]].member_names;
            names.resize(std::max<size_t>(names.size(), w[1] + 1));
            names[w[1]] = text(w + 2, n - 2);
            break;
        }
        case kOpExecutionMode:
            if (w[1] == 17) // LocalSize
                std::copy_n(w + 2, 3, module_.local_size);
            break;
        case kOpCapability:
            capability(w[0]);
            break;
        case kOpDecorate:
            decorate(ids_[w[0]], w[1], n > 2 ? w[2] : 0);
            break;
        case kOpMemberDecorate:
            if (w[2] == kOffset)
                ids_[w[0]].member_offsets[w[1]] = w[3];
            else
                decorate(ids_[w[0]], w[2], 0); // access qualifiers of a block's members hold for the block
            break;
        case kOpTypeInt:
        case kOpTypeFloat:
        case kOpTypeVector:
        case kOpTypeImage:
        case kOpTypeSampledImage:
        case kOpTypeArray:
        case kOpTypeStruct:
        case kOpTypePointer:
            define(op, w[0], w + 1, n - 1);
            break;
        case kOpConstant:
        case kOpSpecConstant:
        case kOpSpecConstantTrue:
        case kOpSpecConstantFalse:
        case kOpSpecConstantOp:
        case kOpSpecConstantComposite:
            define(op, w[1], w + 2, n - 2);
            break;
        case kOpVariable:
            define(op, w[1], w + 2, n - 2);
            ids_[w[1]].operands = {w[0], w[2]}; // pointer type, storage class
            variables_.push_back(w[1]);
            break;
        case kOpTypeCooperativeMatrix: // component, scope, rows, columns, use
            if (ids_[w[1]].operands.at(0) == 16 && ids_[w[5]].operands.at(0) == 2) // fp16 sums
                module_.features |= 32;
            break;
        case kOpSRem:
        case kOpSMod:
            throw std::runtime_error("a % of signed numbers: undefined in Vulkan for negative ones, use unsigned ones");
        default:
            break;
        }
    }

    void define(uint16_t op, uint32_t id, const uint32_t* w, size_t n)
    {
        ids_[id].op = op;
        ids_[id].operands.assign(w, w + n);
    }

    void capability(uint32_t c)
    {
        if (c == 62) // GroupNonUniformVote
            module_.features |= 64;
        if (c == 63) // GroupNonUniformArithmetic
            module_.features |= 1;
        if (c == 64) // GroupNonUniformBallot
            module_.features |= 2;
        if (c == 65 || c == 66) // GroupNonUniformShuffle, ShuffleRelative
            module_.features |= 4;
        if (c == 9) // Float16
            module_.features |= 8;
        if (c == 6022 || c == 5357) // CooperativeMatrixKHR, NV
            module_.features |= 16;
    }

    static void decorate(Id& id, uint32_t decoration, uint32_t value)
    {
        if (decoration == kBinding) {
            id.binding_set = true;
            id.binding = value;
        } else if (decoration == kSpecId) {
            id.spec_set = true;
            id.spec_id = value;
        } else if (decoration == kBuiltIn) {
            id.is_workgroup_size = value == 25; // WorkgroupSize
        } else if (decoration == kNonWritable) {
            id.non_writable = true;
        } else if (decoration == kNonReadable) {
            id.non_readable = true;
        }
    }

    void variable(const Id& v)
    {
        const Id& type = ids_[ids_[v.operands[0]].operands[1]]; // pointee
        switch (v.operands[1]) {
        case kStorageBuffer:
            module_.bindings.push_back({type.name, v.binding, false, !(v.non_readable || type.non_readable),
                                        !(v.non_writable || type.non_writable)});
            break;
        case kUniformConstant:
            if (type.op != kOpTypeSampledImage || ids_[type.operands[0]].operands[1] != 5) // dim Buffer
                throw std::runtime_error("'" + v.name + "': only texel buffers and storage buffers are supported");
            module_.bindings.push_back({v.name, v.binding, true, true, false});
            break;
        case kPushConstant:
            push(type);
            break;
        case kWorkgroup:
            module_.shared_bytes += " + " + bytes(type);
            break;
        default:
            break;
        }
    }

    // the block, or a struct that it holds, is that of C++: 32-bit scalars one after the other
    void push(const Id& block)
    {
        const Id* s = &block;
        while (s->op == kOpTypeStruct && s->operands.size() == 1 && ids_[s->operands[0]].op == kOpTypeStruct)
            s = &ids_[s->operands[0]];
        module_.push_name = s->name;
        for (size_t i = 0; i < s->operands.size(); ++i) {
            const Id& type = ids_[s->operands[i]];
            if (type.op != kOpTypeInt && type.op != kOpTypeFloat)
                throw std::runtime_error("push member '" + s->member_names[i] + "' is not a scalar");
            if (s->member_offsets.at(uint32_t(i)) != module_.push_bytes)
                throw std::runtime_error("push member '" + s->member_names[i] + "' does not follow the one before it");
            const char* cpp = type.op == kOpTypeFloat ? "float" : type.operands.at(1) ? "int32_t" : "uint32_t";
            module_.push.push_back({s->member_names[i], cpp, module_.push_bytes});
            module_.push_bytes += 4;
        }
    }

    // sizes as expressions in C++, because lengths of arrays may depend on specialization constants
    std::string bytes(const Id& type) const
    {
        switch (type.op) {
        case kOpTypeInt:
        case kOpTypeFloat:
            return number(type.operands[0] / 8);
        case kOpTypeVector:
            return bytes(ids_[type.operands[0]]) + " * " + number(type.operands[1]);
        case kOpTypeArray:
            return bytes(ids_[type.operands[0]]) + " * " + length(type.operands[1]);
        case kOpTypeStruct: {
            std::string sum = "(0u";
            for (uint32_t member : type.operands)
                sum += " + " + bytes(ids_[member]);
            return sum + ")";
        }
        default:
            return "4u"; // bool
        }
    }

    static std::string number(uint32_t value) { return std::to_string(value) + "u"; }

    std::string length(uint32_t id) const
    {
        const Id& constant = ids_[id];
        if (constant.op == kOpSpecConstantOp)
            return "(" + operation(constant) + ")";
        if (!constant.spec_set)
            return number(constant.operands.at(0));
        for (size_t i = 0; i < module_.constants.size(); ++i)
            if (module_.constants[i].id == constant.spec_id)
                return "c[" + std::to_string(i) + "]";
        throw std::runtime_error("a shared array's size uses an unknown constant");
    }

    // sums, products, quotients and choices of constants
    std::string operation(const Id& c) const
    {
        const std::map<uint32_t, std::string> kOperators = {// OpIAdd, ISub, IMul, UDiv, SDiv, UGreaterThan
                                                            {128, " + "}, {130, " - "}, {132, " * "},
                                                            {134, " / "}, {135, " / "}, {172, " > "}};
        if (c.operands[0] == 169) // OpSelect
            return length(c.operands.at(1)) + " ? " + length(c.operands.at(2)) + " : " + length(c.operands.at(3));
        const auto found = kOperators.find(c.operands[0]);
        if (found == kOperators.end())
            throw std::runtime_error("a shared array's size uses an operation the reflector does not know");
        return length(c.operands.at(1)) + found->second + length(c.operands.at(2));
    }

    // of local_size_x_id: what the constants of these ids are without a specialization
    void workgroup_size()
    {
        const auto found = std::ranges::find_if(ids_, &Id::is_workgroup_size);
        if (found == ids_.end() || found->op != kOpSpecConstantComposite)
            return;
        for (size_t i = 0; i < 3; ++i) {
            const Id& size = ids_[found->operands.at(i)];
            module_.local_size[i] = size.operands.at(0);
            for (const Constant& c : module_.constants)
                if (size.spec_set && c.id == size.spec_id)
                    module_.local_size[i] = c.value;
        }
    }

    void constants()
    {
        for (const Id& id : ids_) {
            if (!id.spec_set || id.op == 0 || id.name.empty()) // local_size_x_id declares one without a name
                continue;
            const bool is_bool = id.op != kOpSpecConstant;
            const uint32_t value = is_bool ? id.op == kOpSpecConstantTrue : id.operands[0];
            module_.constants.push_back({id.name, id.spec_id, value, is_bool});
        }
    }

    Module module_;
    std::vector<Id> ids_;
    std::vector<uint32_t> variables_;
};

} // namespace

Module reflect(std::vector<uint32_t> code)
{
    return Reader(std::move(code)).run();
}
