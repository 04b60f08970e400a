// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/result.h"

#include <gtest/gtest.h>
#include <string_view>

namespace semrover {

// EXPECT_TRUE(says(result, "text")): result is an error, its message is one line and contains the text
template <typename T>
testing::AssertionResult says(const Result<T>& result, std::string_view text)
{
    if (result)
        return testing::AssertionFailure() << "expected an error that says \"" << text << "\", found success";
    const std::string& message = result.error().message;
    if (message.find(text) == std::string::npos)
        return testing::AssertionFailure() << "expected an error that says \"" << text << "\", found: " << message;
    if (message.find('\n') != std::string::npos)
        return testing::AssertionFailure() << "the message has more than one line: " << message;
    return testing::AssertionSuccess();
}

} // namespace semrover
