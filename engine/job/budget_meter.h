// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/job.h"

#include <algorithm>
#include <chrono>

namespace semrover {

inline double seconds_since(std::chrono::steady_clock::time_point start)
{
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

// what a submit of a job, or another piece of work of one kind, takes
class SubmitCost {
  public:
    // the mean of those so far, in which the last ones weigh most; 0 before the first
    double microseconds() const { return mean_; }
    // that the next one hardly exceeds: the longest of the last ones
    double bound() const { return std::max(mean_, longest_); }
    void add(double us)
    {
        mean_ = mean_ > 0 ? mean_ + (us - mean_) / 4 : us;
        longest_ = std::max(us, longest_ + (us - longest_) / 16);
    }

  private:
    double mean_ = 0, longest_ = 0;
};

// Counts what a step spends of its budget.
//
//     BudgetMeter meter(budget, cost);
//     do { submit something, wait for it if budget.timed(); meter.submitted(); } while (work is left && meter.room());
class BudgetMeter {
  public:
    BudgetMeter(const JobBudget& budget, SubmitCost& cost) : budget_(budget), cost_(&cost) {}
    explicit BudgetMeter(const JobBudget& budget) : budget_(budget) {} // of work of several kinds

    void submitted() { spent(*cost_, true); }
    bool room() const { return room_for(cost_->microseconds()); } // one more submit fits

    // the time since the last piece of work was for one of this kind
    void spent(SubmitCost& cost, bool submit)
    {
        const double now = elapsed();
        cost.add(now - last_);
        last_ = now;
        submits_ += submit;
    }
    bool room_for(double microseconds) const
    {
        return submits_ < budget_.submits &&
               (!budget_.timed() || elapsed() + microseconds <= double(budget_.microseconds));
    }
    double elapsed() const // microseconds
    {
        return std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - begin_).count();
    }

  private:
    JobBudget budget_;
    SubmitCost* cost_ = nullptr;
    std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
    double last_ = 0; // elapsed() at the last submit
    uint32_t submits_ = 0;
};

} // namespace semrover
