#include "history.hpp"

#include <algorithm>
#include <array>
#include <iostream>

#include "rtpm/base/hash.hpp"

namespace rtpm::sim {
namespace {

constexpr std::array<std::string_view, 6> kOutcomeNames{"open",         "done",     "not run",
                                                        "may have run", "received", "sent"};

std::string name_of(History::Token token) {
  return "call " + std::to_string(token % 1'000'000) + " of client " +
         std::to_string(token / 1'000'000);
}

}  // namespace

History::Token History::begin(MonotonicTime now, std::uint32_t client, bool is_idempotent,
                              MonotonicTime deadline) {
  const Token token = Token{client} * 1'000'000 + calls_.size() + 1;
  calls_[token] = {.is_idempotent = is_idempotent, .deadline = deadline};
  note(now, name_of(token) + " begins" + (is_idempotent ? ", idempotent" : ""));
  return token;
}

std::uint32_t History::run(MonotonicTime now, Token token, std::optional<Duration> tolerance) {
  const auto found = calls_.find(token);
  if (found == calls_.end()) {
    fault(now, token, "ran, but nobody made it");
    return 0;
  }
  Call& call = found->second;
  ++call.run_count;
  note(now, name_of(token) + " runs");
  if (call.run_count > 1 && !call.is_idempotent) fault(now, token, "ran twice");
  // A budget is stated in whole microseconds, rounded up.
  if (tolerance && now > call.deadline + *tolerance) {
    fault(now, token, "was begun after its deadline");
  }
  return call.run_count;
}

void History::reply(MonotonicTime now, Token token, Token replied, std::uint32_t run_number) {
  if (replied != token) fault(now, token, "got the reply of " + name_of(replied));
  const Call& call = calls_[token];
  if (run_number == 0 || run_number > call.run_count) fault(now, token, "got a made-up reply");
}

std::uint32_t History::give_item(Token token) {
  return calls_[token].item_count++;
}

void History::end_stream(MonotonicTime now, Token token, std::uint32_t item_count) {
  if (item_count == calls_[token].item_count) return;
  fault(now, token, "lost " + std::to_string(calls_[token].item_count - item_count) + " items");
}

void History::end(MonotonicTime now, Token token, Outcome outcome, std::string_view why) {
  Call& call = calls_[token];
  if (call.outcome != Outcome::kOpen) fault(now, token, "ended twice");
  call.outcome = outcome;
  note(now, name_of(token) +
                " ends: " + std::string(kOutcomeNames[static_cast<std::size_t>(outcome)]) + ", " +
                std::string(why));
}

void History::note(MonotonicTime now, const std::string& what) {
  const std::string line = std::to_string(to_ns(now) / 1000 % 1'000'000'000) + " us: " + what;
  hash_ = fnv1a_64(line, hash_);
  if (is_told_) std::cout << line << '\n';
}

void History::finish() {
  for (const auto& [token, call] : calls_) {
    if (call.outcome == Outcome::kOpen) fault({}, token, "never ended");
    if (call.outcome == Outcome::kNotRun && call.run_count > 0) {
      fault({}, token, "ran, though its caller was told that it did not");
    }
    if (call.outcome == Outcome::kDone && call.run_count == 0) {
      fault({}, token, "did not run, though its caller was told that it did");
    }
  }
}

std::uint64_t History::count(Outcome outcome) const {
  return static_cast<std::uint64_t>(std::ranges::count_if(
      calls_, [&](const auto& entry) { return entry.second.outcome == outcome; }));
}

void History::broken(MonotonicTime now, const std::string& what) {
  faults_.push_back(what);
  note(now, "FAULT: " + what);
}

void History::fault(MonotonicTime now, Token token, const std::string& what) {
  faults_.push_back(name_of(token) + " " + what);
  note(now, "FAULT: " + faults_.back());
}

}  // namespace rtpm::sim
