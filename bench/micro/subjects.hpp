#pragma once

#include <vector>

/// The functions that the microbenchmarks time and the instruction gate counts.
namespace rtpm::bench::micro {

/// How often a subject runs at a time.
inline constexpr int kRepeatCount = 200;

struct Subject {
  const char* name;
  void (*run)();  ///< Runs it kRepeatCount times. Its symbol is counted_NAME.
};

/// All subjects, in the order of their definitions.
[[nodiscard]] inline std::vector<Subject>& subjects() {
  static std::vector<Subject> all;
  return all;
}

}  // namespace rtpm::bench::micro
