#include "figures/report.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace rtpm::bench {
namespace {

struct Point {
  std::string name;
  double percent;
};
const std::array<Point, 4> kPoints{{{"p50", 50}, {"p90", 90}, {"p99", 99}, {"p999", 99.9}}};

std::string text_of(const Json& value) {
  if (value.is_string()) return value.get<std::string>();
  return value.is_number_float() ? short_text(value.get<double>()) : value.dump();
}

/// A line of figures: a distribution's (`unit` "_us") or those of ratios.
std::string line_of(const Json& result, const std::string& prefix, const std::string& unit) {
  std::string name = prefix.empty() ? result.value("peer", "RTPM") : prefix;
  std::ranges::replace(name, '_', ' ');
  std::array<char, 96> text{};
  std::snprintf(text.data(), text.size(), "  %-22s", name.c_str());
  std::string line = text.data();
  for (const char* point : {"p50", "p90", "p99", "p999", "p9999", "max"}) {
    std::string key = prefix;
    key.append(point).append(unit);
    const auto found = result.find(key);
    const bool is_there = found != result.end() && found->is_number();
    std::snprintf(text.data(), text.size(), " %9s", is_there ? text_of(*found).c_str() : "");
    line += text.data();
  }
  return line + "\n";
}

/// Prints the result's key and single figures on the first line, distributions and ratios below.
void print_table(const Json& result) {
  std::string head;
  std::string lines;
  for (const auto& [key, value] : result.items()) {
    if (key.find("rounds_p") != std::string::npos || key == "marks") continue;
    if (key.ends_with("p50_us")) {
      lines += line_of(result, key.substr(0, key.size() - 6), "_us");
    } else if (key.ends_with("p50_low")) {
      lines += line_of(result, key.substr(0, key.size() - 7), "");
    } else if (key.find("p50") == std::string::npos && key.find("p9") == std::string::npos &&
               !key.ends_with("max_us") && !value.is_array()) {
      head += (head.empty() ? "" : ", " + key + " ") + text_of(value);
    }
  }
  std::printf("\n%s\n", head.c_str());
  if (!lines.empty()) {
    std::printf("  %-22s %9s %9s %9s %9s %9s %9s\n%s", "microseconds", "p50", "p90", "p99", "p99.9",
                "p99.99", "max", lines.c_str());
  }
  for (const Json& mark : result.value("marks", Json::array()))
    std::printf("  ! %s\n", text_of(mark).c_str());
}

}  // namespace

void Report::add(Json result) {
  if (form_ == Form::kJsonLines) {
    result.emplace("marks", Json::array());
    result["environment"] = environment_;
    std::printf("%s\n", result.dump().c_str());
  } else {
    for (const auto& [key, value] : environment_.items()) {
      if (!has_begun_) std::printf("%s: %s\n", key.c_str(), text_of(value).c_str());
    }
    print_table(result);
  }
  std::fflush(stdout);
  has_begun_ = true;
}

void Report::fail(std::string_view what, std::string_view why) {
  say(what, why);
  is_complete_ = false;
}

void say(std::string_view what, std::string_view why) {
  std::fprintf(stderr, "rtpm-bench: %.*s: %.*s\n", static_cast<int>(what.size()), what.data(),
               static_cast<int>(why.size()), why.data());
}

void add_mark(Json& result, const std::string& mark) {
  result["marks"].push_back(mark);
}

double rounded(double value) noexcept {
  return std::round(value * 1000) / 1000;
}

void add_distribution(Json& result, const std::string& prefix, const Samples& samples) {
  const Percentiles values = samples.percentiles();
  for (const auto& [name, value] : {std::pair{"p50_us", values.p50},
                                    {"p90_us", values.p90},
                                    {"p99_us", values.p99},
                                    {"p999_us", values.p999},
                                    {"p9999_us", values.p9999},
                                    {"max_us", values.max}}) {
    result[prefix + name] = rounded(value);
  }
  for (const Point& point : kPoints) {
    std::vector<double> rounds = samples.stretch_percentiles(point.percent);
    std::ranges::transform(rounds, rounds.begin(), rounded);
    result[prefix + "rounds_" + point.name + "_us"] = std::move(rounds);
  }
}

void add_ratios(Json& result, const std::string& prefix, const Samples& numerator,
                const Samples& denominator) {
  for (const Point& point : kPoints) {
    const Ratio ratio = ratio_at(numerator, denominator, point.percent);
    result[prefix + point.name] = rounded(ratio.middle);
    result[prefix + point.name + "_low"] = rounded(ratio.low);
    result[prefix + point.name + "_high"] = rounded(ratio.high);
  }
}

void add_rounds(Json& result, const Samples& one, const Samples& other) {
  const int all = std::min(one.round_count(), other.round_count());
  const int left_out = all - static_cast<int>(rounds_that_count(one, other).size());
  const int disturbed = disturbed_round_count(one, other);
  result["rounds"] = all;
  result["rounds_left_out"] = left_out;
  if (disturbed == 0 || left_out > 0) return;
  add_mark(result, "the machine stood still in " + std::to_string(disturbed) + " of " +
                       std::to_string(all) + " rounds, too many to be left out");
}

std::string short_text(double value) {
  const double size = std::abs(value);
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), "%.*f",
                size == 0 || size >= 100 ? 0 : (size < 10 ? 2 : 1), value);
  return text.data();
}

}  // namespace rtpm::bench
