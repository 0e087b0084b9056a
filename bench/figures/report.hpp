#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "figures/samples.hpp"

namespace rtpm::bench {

/// A result: its key (case, transport, wait, …), and then its figures. Its "marks" say what
/// disturbed it.
using Json = nlohmann::ordered_json;

/// Prints results as they come, so that an interrupted run keeps what it has.
class Report {
 public:
  enum class Form : std::uint8_t { kTable, kJsonLines };
  Report(Form form, Json environment) : form_(form), environment_(std::move(environment)) {}

  void add(Json result);
  /// Reports that `what` could not be measured.
  void fail(std::string_view what, std::string_view why);
  /// Whether everything was measured that was asked for.
  [[nodiscard]] bool is_complete() const noexcept { return is_complete_; }

 private:
  Form form_;
  Json environment_;
  bool has_begun_ = false;
  bool is_complete_ = true;
};

/// "rtpm-bench: <what>: <why>" on standard error.
void say(std::string_view what, std::string_view why);

/// Adds a text to "marks".
void add_mark(Json& result, const std::string& mark);

/// Rounds to three decimals.
[[nodiscard]] double rounded(double value) noexcept;

/// Adds "<prefix>p50_us" … "<prefix>max_us", and each round's own figures, "<prefix>rounds_p50_us"
/// and so on for p90, p99 and p99.9 (of each stretch of rounds). From these a comparison of two
/// runs derives how far the figures can be trusted.
void add_distribution(Json& result, const std::string& prefix, const Samples& samples);

/// Adds the ratios of two contenders: "<prefix>p50", "<prefix>p90", "<prefix>p99" and
/// "<prefix>p999", each with "_low" and "_high".
void add_ratios(Json& result, const std::string& prefix, const Samples& numerator,
                const Samples& denominator);

/// Adds "rounds" and "rounds_left_out" of two interleaved contenders, and a mark if too many rounds
/// were disturbed to leave them out.
void add_rounds(Json& result, const Samples& one, const Samples& other);

/// A number with three significant digits or so: "9.87", "123".
[[nodiscard]] std::string short_text(double value);

}  // namespace rtpm::bench
