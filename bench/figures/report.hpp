#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "figures/samples.hpp"

namespace rtpm::bench {

/// A JSON object under construction, its members in the order of adding.
class JsonObject {
 public:
  void add(std::string_view key, std::string_view value);
  void add(std::string_view key, const char* value) { add(key, std::string_view(value)); }
  void add(std::string_view key, bool value);
  void add(std::string_view key, std::int64_t value);
  void add(std::string_view key, int value) { add(key, std::int64_t{value}); }
  /// Three decimals; a number that is none becomes null.
  void add(std::string_view key, double value);
  void add(std::string_view key, const std::vector<std::string>& values);
  void add(std::string_view key, const std::vector<double>& values);
  void add(std::string_view key, const JsonObject& value);

  [[nodiscard]] std::string text() const { return "{" + members_ + "}"; }

 private:
  void add_raw(std::string_view key, std::string_view json);
  std::string members_;
};

/// One line of a result's table for people.
struct Row {
  std::string name;
  Percentiles values;
};

/// What a case found, for people and for programs.
struct Result {
  std::string title{};  ///< For people: the case and what it varied.
  /// For people: distributions, one below the other. With neither these nor notes, there is
  /// nothing for people: what they are to see stands in another result.
  std::vector<Row> rows{};
  std::vector<std::string> notes{};  ///< For people: further findings, a sentence each.
  std::vector<std::string> marks{};  ///< What disturbed the run; programs get them, too.
  JsonObject json{};                 ///< For programs.
};

/// Prints results as they come, so that an interrupted run keeps what it has.
class Report {
 public:
  enum class Form : std::uint8_t { kTable, kJsonLines };
  Report(Form form, JsonObject environment, std::string environment_text);

  void add(const Result& result);
  [[nodiscard]] int result_count() const noexcept { return result_count_; }

 private:
  Form form_;
  JsonObject environment_;
  std::string environment_text_;
  int result_count_ = 0;
};

/// "rtpm-bench: <what>: <why>" on standard error.
void say_not_measured(std::string_view what, std::string_view why);

/// Adds "<prefix>p50_us" … "<prefix>max_us".
void add_percentiles(JsonObject& json, std::string_view prefix, const Percentiles& values);

/// As add_percentiles(); and what each round showed by itself, "<prefix>rounds_p50_us" and so on
/// for p90, p99 and p99.9 (of each stretch of rounds), from which a comparison of two runs tells
/// how far they are to be trusted.
void add_distribution(JsonObject& json, std::string_view prefix, const Samples& samples);

/// How two contenders compare: adds "<prefix>p50", "<prefix>p90", "<prefix>p99" and "<prefix>p999",
/// each with "_low" and "_high". Gives back the ratios.
Percentiles add_ratios(JsonObject& json, const std::string& prefix, const Samples& numerator,
                       const Samples& denominator);

/// Adds "rounds" and "rounds_left_out" of two interleaved contenders, with a note on the disturbed
/// rounds, or a mark where they are too many to leave out.
void add_rounds(Result& result, const Samples& one, const Samples& other);

/// A number with three significant places or so: "9.87", "123".
[[nodiscard]] std::string short_text(double value);

}  // namespace rtpm::bench
