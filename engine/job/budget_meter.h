// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/job.h"

#include <chrono>

namespace semrover {

// what a submit of a job takes: the mean of those so far, in which the last ones weigh most
class SubmitCost {
  public:
    double microseconds() const { return mean_; } // 0 before the first
    void add(double us) { mean_ = mean_ > 0 ? mean_ + (us - mean_) / 4 : us; }

  private:
    double mean_ = 0;
};

// Counts what a step spends of its budget.
//
//     BudgetMeter meter(budget, cost);
//     do { submit something, wait for it if budget.timed(); meter.submitted(); } while (work is left && meter.room());
class BudgetMeter {
  public:
    BudgetMeter(const JobBudget& budget, SubmitCost& cost) : budget_(budget), cost_(cost) {}

    void submitted()
    {
        const double now = elapsed();
        cost_.add(now - last_);
        last_ = now;
        ++submits_;
    }
    // one more submit fits
    bool room() const
    {
        return submits_ < budget_.submits &&
               (!budget_.timed() || elapsed() + cost_.microseconds() <= double(budget_.microseconds));
    }
    double elapsed() const // microseconds
    {
        return std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - begin_).count();
    }

  private:
    JobBudget budget_;
    SubmitCost& cost_;
    std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
    double last_ = 0; // elapsed() at the last submit
    uint32_t submits_ = 0;
};

} // namespace semrover
