#include "laboratory/supervision.hpp"

#include <gtest/gtest.h>

#include <csignal>

#include <string>
#include <vector>

// The supervision of a laboratory's programs, in virtual time and without processes.
namespace rtpm::laboratory {
namespace {

using namespace std::chrono_literals;
using Action = Supervision::Action;
using Actions = std::vector<Action>;
using enum Supervision::Order;

constexpr ProcessEnd kSuccess{.exit_code = 0};
constexpr ProcessEnd kFault{.exit_code = 3};
constexpr ProcessEnd kTerminated{.exit_code = std::nullopt, .signal = SIGTERM};

/// Programs that each depend on the one before.
Plan chain(std::size_t count) {
  Plan plan{.name = "cell"};
  for (std::size_t i = 0; i < count; ++i) {
    ProgramPlan program;
    program.name = std::string(1, static_cast<char>('a' + i));
    if (i > 0) program.after = {i - 1};
    plan.programs.push_back(std::move(program));
    plan.order.push_back(i);
  }
  return plan;
}

class Supervised : public testing::Test {
 protected:
  void begin(Plan plan) {
    plan_ = std::move(plan);
    supervision_.emplace(plan_, now_);
  }
  Actions due() { return supervision_->due(now_); }
  void pass(Duration time) { now_ += time; }
  /// Starts programs that are due, until none is.
  void start_all() {
    for (Actions actions = due(); !actions.empty(); actions = due()) {
      for (const Action& action : actions) {
        ASSERT_EQ(action.order, kStart);
        supervision_->started(action.program, 100 + static_cast<int>(action.program), now_);
      }
    }
  }
  void exit(std::size_t program, ProcessEnd end) { supervision_->exited(program, end, now_); }
  [[nodiscard]] State state(std::size_t program) const {
    return supervision_->status(program).state;
  }
  [[nodiscard]] const std::string& note(std::size_t program) const {
    return supervision_->status(program).note;
  }
  Supervision& supervision() { return *supervision_; }

  Plan plan_{};
  MonotonicTime now_ = time_from_ns(1'000'000'000);
  std::optional<Supervision> supervision_{};
};

TEST_F(Supervised, StartsEachProgramWhenTheOneBeforeServes) {
  Plan plan = chain(3);
  plan.programs[0].readiness = Readiness::kUrl;
  plan.programs[1].readiness = Readiness::kNames;
  begin(plan);
  EXPECT_EQ(due(), (Actions{{kStart, 0}}));
  EXPECT_EQ(due(), Actions{});
  supervision().started(0, 10, now_);
  EXPECT_EQ(due(), Actions{});
  supervision().has_url(0, "rtpm://a", now_);
  EXPECT_EQ(state(0), State::kServing);
  EXPECT_EQ(due(), (Actions{{kStart, 1}}));
  supervision().started(1, 11, now_);
  EXPECT_FALSE(supervision().is_up());
  supervision().is_ready(1, now_);
  EXPECT_EQ(due(), (Actions{{kStart, 2}}));
  supervision().started(2, 12, now_);
  EXPECT_EQ(due(), Actions{});
  EXPECT_TRUE(supervision().is_up());
}

TEST_F(Supervised, StartsIndependentProgramsTogether) {
  Plan plan = chain(2);
  plan.programs[1].after.clear();
  begin(plan);
  EXPECT_EQ(due(), (Actions{{kStart, 0}, {kStart, 1}}));
}

TEST_F(Supervised, WaitsForTheEndOfAOneShot) {
  Plan plan = chain(2);
  plan.programs[0].readiness = Readiness::kExit;
  begin(plan);
  start_all();
  EXPECT_EQ(state(1), State::kWaiting);
  exit(0, kSuccess);
  EXPECT_EQ(due(), (Actions{{kStart, 1}}));
  EXPECT_EQ(state(0), State::kDone);
}

TEST_F(Supervised, WaitsForAUrlThatOthersAreGivenBesidesItsLine) {
  Plan plan = chain(2);
  plan.programs[0].readiness = Readiness::kLine;
  plan.programs[0].has_url = true;
  begin(plan);
  start_all();
  supervision().is_ready(0, now_);
  EXPECT_EQ(state(0), State::kStarting);
  supervision().has_url(0, "rtpm://a", now_);
  EXPECT_EQ(state(0), State::kServing);
}

TEST_F(Supervised, EndsInReverseOrder) {
  begin(chain(3));
  start_all();
  supervision().stop(now_);
  for (const std::size_t program : {2u, 1u, 0u}) {
    EXPECT_EQ(due(), (Actions{{kStop, program}}));
    EXPECT_EQ(due(), Actions{});
    exit(program, kTerminated);
  }
  EXPECT_EQ(due(), Actions{});
  EXPECT_TRUE(supervision().is_over());
  EXPECT_FALSE(supervision().has_failed());
}

TEST_F(Supervised, KillsWhatDoesNotEndInTime) {
  begin(chain(1));
  start_all();
  supervision().stop(now_);
  EXPECT_EQ(due(), (Actions{{kStop, 0}}));
  EXPECT_EQ(supervision().next(), now_ + 2s);
  pass(1999ms);
  EXPECT_EQ(due(), Actions{});
  pass(1ms);
  EXPECT_EQ(due(), (Actions{{kKill, 0}}));
  EXPECT_EQ(due(), Actions{});
  exit(0, {.exit_code = std::nullopt, .signal = SIGKILL});
  EXPECT_EQ(state(0), State::kFailed);
  EXPECT_NE(note(0).find("within 2s of SIGTERM"), std::string::npos) << note(0);
}

TEST_F(Supervised, JudgesHowAProgramEndsThatWasAskedTo) {
  for (const auto& [end, is_right] : std::vector<std::pair<ProcessEnd, bool>>{
           {kSuccess, true},
           {kTerminated, true},
           {{.exit_code = 143}, true},  // A shell's exit code for SIGTERM.
           {{.exit_code = 3}, false},
           {{.exit_code = std::nullopt, .signal = SIGSEGV}, false}}) {
    begin(chain(1));
    start_all();
    supervision().stop(now_);
    due();
    exit(0, end);
    EXPECT_EQ(state(0), is_right ? State::kEnded : State::kFailed) << end.text();
    EXPECT_EQ(supervision().has_failed(), !is_right);
  }
}

TEST_F(Supervised, KillsAllAtOnceOnRequest) {
  begin(chain(2));
  start_all();
  supervision().stop(now_);
  due();
  supervision().kill(now_);
  EXPECT_EQ(due(), (Actions{{kKill, 0}, {kKill, 1}}));
  exit(0, {.exit_code = std::nullopt, .signal = SIGKILL});
  exit(1, {.exit_code = std::nullopt, .signal = SIGKILL});
  EXPECT_TRUE(supervision().is_over());
  EXPECT_EQ(note(0), "killed");
}

TEST_F(Supervised, RestartsWithBackOffUpToTheLimit) {
  Plan plan = chain(1);
  plan.programs[0].restart = Restart::kOnFailure;
  plan.programs[0].restart_limit = 4;
  plan.programs[0].restart_delay = 1s;
  plan.programs[0].restart_delay_max = 3s;
  begin(plan);
  start_all();
  for (const Duration delay : {1s, 2s, 3s, 3s}) {
    exit(0, kFault);
    EXPECT_EQ(due(), Actions{});
    EXPECT_EQ(state(0), State::kPausing);
    EXPECT_EQ(note(0), "exit code 3");
    EXPECT_EQ(supervision().next(), now_ + delay);
    pass(delay - 1ns);
    EXPECT_EQ(due(), Actions{});
    pass(1ns);
    start_all();
    EXPECT_EQ(state(0), State::kServing);
  }
  exit(0, kFault);
  due();
  EXPECT_EQ(state(0), State::kFailed);
  EXPECT_NE(note(0).find("4 restarts within 1min"), std::string::npos) << note(0);
  EXPECT_TRUE(supervision().is_over());
  EXPECT_TRUE(supervision().has_failed());
  EXPECT_EQ(supervision().status(0).restart_count, 4u);
}

TEST_F(Supervised, ForgetsRestartsBeyondTheWindow) {
  Plan plan = chain(1);
  plan.programs[0].restart = Restart::kAlways;
  plan.programs[0].restart_limit = 1;
  plan.programs[0].restart_window = 10s;
  begin(plan);
  start_all();
  for (int turn = 0; turn < 5; ++turn) {
    exit(0, kSuccess);
    EXPECT_EQ(due(), Actions{});
    EXPECT_EQ(supervision().next(), now_ + 200ms);  // The back-off starts anew, too.
    pass(11s);
    start_all();
    ASSERT_EQ(state(0), State::kServing) << turn;
  }
}

TEST_F(Supervised, RestartsAsItsPolicySays) {
  for (const auto& [restart, end, state_after] :
       std::vector<std::tuple<Restart, ProcessEnd, State>>{
           {Restart::kNever, kSuccess, State::kDone},
           {Restart::kNever, kFault, State::kFailed},
           {Restart::kOnFailure, kSuccess, State::kDone},
           {Restart::kOnFailure, kTerminated, State::kPausing},
           {Restart::kAlways, kSuccess, State::kPausing},
           {Restart::kAlways, kFault, State::kPausing}}) {
    Plan plan = chain(1);
    plan.programs[0].restart = restart;
    begin(plan);
    start_all();
    exit(0, end);
    EXPECT_EQ(state(0), state_after) << static_cast<int>(restart) << " " << end.text();
  }
}

TEST_F(Supervised, EndsTheLaboratoryThatDoesNotComeUp) {
  Plan plan = chain(3);
  plan.programs[1].readiness = Readiness::kNames;
  plan.programs[1].ready_deadline = 5s;
  begin(plan);
  start_all();
  pass(5s);
  EXPECT_EQ(due(), (Actions{{kStop, 1}}));
  exit(1, kTerminated);
  EXPECT_EQ(due(), (Actions{{kStop, 0}}));
  EXPECT_EQ(state(1), State::kFailed);
  EXPECT_EQ(note(1), "it did not serve within 5s");
  EXPECT_EQ(state(2), State::kEnded);
  exit(0, kTerminated);
  EXPECT_TRUE(supervision().is_over());
  EXPECT_TRUE(supervision().has_failed());
}

TEST_F(Supervised, TakesAnEndBeforeServingForAFailure) {
  Plan plan = chain(1);
  plan.programs[0].readiness = Readiness::kUrl;
  begin(plan);
  start_all();
  exit(0, kSuccess);
  EXPECT_EQ(state(0), State::kFailed);
  EXPECT_EQ(note(0), "it ended before it served");
}

TEST_F(Supervised, TakesAProgramThatDoesNotStartForAFailure) {
  begin(chain(1));
  EXPECT_EQ(due(), (Actions{{kStart, 0}}));
  supervision().not_started(0, "no such file", now_);
  EXPECT_EQ(state(0), State::kFailed);
  EXPECT_EQ(note(0), "no such file");
}

TEST_F(Supervised, GoesOnWithoutAProgramThatFailsLater) {
  begin(chain(2));
  start_all();
  exit(1, kFault);
  EXPECT_EQ(due(), Actions{});
  EXPECT_FALSE(supervision().is_over());
  EXPECT_TRUE(supervision().has_failed());
}

TEST_F(Supervised, EndsWithANeededProgramThatFails) {
  Plan plan = chain(2);
  plan.programs[1].is_needed = true;
  begin(plan);
  start_all();
  exit(1, kFault);
  EXPECT_EQ(due(), (Actions{{kStop, 0}}));
}

TEST_F(Supervised, EndsWhenAllMainProgramsHaveEnded) {
  Plan plan = chain(3);
  plan.programs[1].is_main = plan.programs[2].is_main = true;
  begin(plan);
  start_all();
  exit(1, kSuccess);
  EXPECT_EQ(due(), Actions{});
  exit(2, kSuccess);
  EXPECT_EQ(due(), (Actions{{kStop, 0}}));
  exit(0, kTerminated);
  EXPECT_TRUE(supervision().is_over());
  EXPECT_FALSE(supervision().has_failed());
}

TEST_F(Supervised, RestartsTheProgramsThatHaveAUrlThatIsNoLongerTrue) {
  Plan plan = chain(3);
  plan.programs[0].readiness = Readiness::kUrl;
  plan.programs[0].restart = Restart::kOnFailure;
  plan.programs[2].uses = {0};
  begin(plan);
  due();
  supervision().started(0, 10, now_);
  supervision().has_url(0, "rtpm://a:1", now_);
  start_all();
  ASSERT_TRUE(supervision().is_up());
  for (const auto& [url, is_new] :
       {std::pair("rtpm://a:1", false), std::pair("rtpm://a:2", true)}) {
    exit(0, kFault);
    pass(10s);
    EXPECT_EQ(due(), (Actions{{kStart, 0}}));
    supervision().started(0, 10, now_);
    EXPECT_EQ(due(), Actions{});
    supervision().has_url(0, url, now_);
    EXPECT_EQ(due(), is_new ? (Actions{{kStop, 2}}) : Actions{}) << url;
  }
  exit(2, kTerminated);
  EXPECT_EQ(due(), (Actions{{kStart, 2}}));
  EXPECT_EQ(supervision().status(2).restart_count, 1u);
  EXPECT_EQ(state(1), State::kServing);
}

TEST_F(Supervised, RestartsBehindAProgramThatIsDownItself) {
  Plan plan = chain(2);
  for (ProgramPlan& program : plan.programs)
    program.restart = Restart::kOnFailure;
  plan.programs[0].restart_delay = 1s;
  plan.programs[0].readiness = Readiness::kUrl;
  begin(plan);
  due();
  supervision().started(0, 10, now_);
  supervision().has_url(0, "rtpm://a", now_);
  start_all();
  exit(0, kFault);
  exit(1, kFault);
  pass(500ms);
  EXPECT_EQ(due(), Actions{});
  EXPECT_EQ(state(1), State::kWaiting);
  pass(500ms);
  EXPECT_EQ(due(), (Actions{{kStart, 0}}));
  supervision().started(0, 10, now_);
  EXPECT_EQ(due(), Actions{});
  supervision().has_url(0, "rtpm://a", now_);
  EXPECT_EQ(due(), (Actions{{kStart, 1}}));
}

TEST_F(Supervised, FailsBehindAProgramThatHasFailed) {
  Plan plan = chain(2);
  plan.programs[1].restart = Restart::kOnFailure;
  begin(plan);
  start_all();
  exit(0, kFault);
  exit(1, kFault);
  pass(1s);
  EXPECT_EQ(due(), Actions{});
  EXPECT_EQ(state(1), State::kFailed);
  EXPECT_NE(note(1).find("a, which it comes after, has failed"), std::string::npos) << note(1);
}

TEST_F(Supervised, ReportsEachChange) {
  begin(chain(1));
  due();
  EXPECT_EQ(supervision().take_changes(), std::vector<std::size_t>{0});
  EXPECT_TRUE(supervision().take_changes().empty());
  supervision().started(0, 10, now_);
  EXPECT_FALSE(supervision().take_changes().empty());
  EXPECT_EQ(supervision().status(0).process, 10);
  EXPECT_EQ(supervision().status(0).since, now_);
}

}  // namespace
}  // namespace rtpm::laboratory
