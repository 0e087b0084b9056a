#include "figures/report.hpp"

#include <array>
#include <cmath>
#include <cstdio>

namespace rtpm::bench {
namespace {

std::string quoted(std::string_view text) {
  std::string json = "\"";
  for (const char character : text) {
    const auto code = static_cast<unsigned char>(character);
    if (character == '"' || character == '\\') {
      json += '\\';
      json += character;
    } else if (code < 0x20) {
      std::array<char, 8> escape{};
      std::snprintf(escape.data(), escape.size(), "\\u%04x", code);
      json += escape.data();
    } else {
      json += character;
    }
  }
  return json + "\"";
}

std::string fixed_text(double value, int decimals) {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), "%.*f", decimals, value);
  return text.data();
}

void print_row(const Row& row) {
  const Percentiles& v = row.values;
  std::printf("  %-22s", row.name.c_str());
  for (const double value : {v.p50, v.p90, v.p99, v.p999, v.p9999, v.max}) {
    std::printf(" %9s", short_text(value).c_str());
  }
  std::printf("\n");
}

void print_table(const Result& result) {
  std::printf("\n%s\n", result.title.c_str());
  if (!result.rows.empty()) {
    std::printf("  %-22s %9s %9s %9s %9s %9s %9s\n", "microseconds", "p50", "p90", "p99", "p99.9",
                "p99.99", "max");
  }
  for (const Row& row : result.rows)
    print_row(row);
  for (const std::string& note : result.notes)
    std::printf("  %s\n", note.c_str());
  for (const std::string& mark : result.marks)
    std::printf("  ! %s\n", mark.c_str());
}

}  // namespace

void JsonObject::add_raw(std::string_view key, std::string_view json) {
  if (!members_.empty()) members_ += ", ";
  members_ += quoted(key) + ": " + std::string(json);
}

void JsonObject::add(std::string_view key, std::string_view value) {
  add_raw(key, quoted(value));
}

void JsonObject::add(std::string_view key, bool value) {
  add_raw(key, value ? "true" : "false");
}

void JsonObject::add(std::string_view key, std::int64_t value) {
  add_raw(key, std::to_string(value));
}

void JsonObject::add(std::string_view key, double value) {
  add_raw(key, std::isfinite(value) ? fixed_text(value, 3) : "null");
}

void JsonObject::add(std::string_view key, const std::vector<std::string>& values) {
  std::string list;
  for (const std::string& value : values)
    list += (list.empty() ? "" : ", ") + quoted(std::string_view(value));
  add_raw(key, "[" + list + "]");
}

void JsonObject::add(std::string_view key, const std::vector<double>& values) {
  std::string list;
  for (const double value : values) {
    list += list.empty() ? "" : ", ";
    list += std::isfinite(value) ? fixed_text(value, 3) : "null";
  }
  add_raw(key, "[" + list + "]");
}

void JsonObject::add(std::string_view key, const JsonObject& value) {
  add_raw(key, value.text());
}

Report::Report(Form form, JsonObject environment, std::string environment_text)
    : form_(form),
      environment_(std::move(environment)),
      environment_text_(std::move(environment_text)) {}

void Report::add(const Result& result) {
  if (form_ == Form::kJsonLines) {
    JsonObject json = result.json;
    json.add("marks", result.marks);
    json.add("environment", environment_);
    std::printf("%s\n", json.text().c_str());
  } else {
    // A result that has nothing for people stands in another one's rows.
    if (result.rows.empty() && result.notes.empty()) return;
    if (result_count_ == 0) std::printf("%s\n", environment_text_.c_str());
    print_table(result);
  }
  std::fflush(stdout);
  ++result_count_;
}

void say_not_measured(std::string_view what, std::string_view why) {
  std::fprintf(stderr, "rtpm-bench: %.*s: %.*s\n", static_cast<int>(what.size()), what.data(),
               static_cast<int>(why.size()), why.data());
}

void add_percentiles(JsonObject& json, std::string_view prefix, const Percentiles& values) {
  const std::string begin(prefix);
  json.add(begin + "p50_us", values.p50);
  json.add(begin + "p90_us", values.p90);
  json.add(begin + "p99_us", values.p99);
  json.add(begin + "p999_us", values.p999);
  json.add(begin + "p9999_us", values.p9999);
  json.add(begin + "max_us", values.max);
}

void add_distribution(JsonObject& json, std::string_view prefix, const Samples& samples) {
  add_percentiles(json, prefix, samples.percentiles());
  const std::string begin(prefix);
  for (const auto& [name, percent] :
       {std::pair{"p50", 50.0}, {"p90", 90.0}, {"p99", 99.0}, {"p999", 99.9}}) {
    json.add(begin + "rounds_" + name + "_us", samples.stretch_percentiles(percent));
  }
}

void add_rounds(Result& result, const Samples& one, const Samples& other) {
  const int all = std::min(one.round_count(), other.round_count());
  const int left_out = all - static_cast<int>(rounds_that_count(one, other).size());
  const int disturbed = disturbed_round_count(one, other);
  result.json.add("rounds", all);
  result.json.add("rounds_left_out", left_out);
  if (disturbed == 0) return;
  const std::string text = "the machine stood still in " + std::to_string(disturbed) + " of " +
                           std::to_string(all) + " rounds, ";
  if (left_out > 0) {
    result.notes.push_back(text + "which are left out, but for p99.99 and max");
  } else {
    result.marks.push_back(text + "too many to be left out");
  }
}

Percentiles add_ratios(JsonObject& json, const std::string& prefix, const Samples& numerator,
                       const Samples& denominator) {
  Percentiles ratios;
  const auto add = [&](const std::string& name, double percent, double& middle) {
    const Ratio ratio = ratio_at(numerator, denominator, percent);
    json.add(prefix + name, ratio.middle);
    json.add(prefix + name + "_low", ratio.low);
    json.add(prefix + name + "_high", ratio.high);
    middle = ratio.middle;
  };
  add("p50", 50, ratios.p50);
  add("p90", 90, ratios.p90);
  add("p99", 99, ratios.p99);
  add("p999", 99.9, ratios.p999);
  return ratios;
}

std::string short_text(double value) {
  if (value == 0) return "0";
  const double size = std::abs(value);
  return fixed_text(value, size < 10 ? 2 : size < 100 ? 1 : 0);
}

}  // namespace rtpm::bench
