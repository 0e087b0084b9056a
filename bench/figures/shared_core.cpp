#include "figures/shared_core.hpp"

#include <algorithm>
#include <cstdint>
#include <limits>

#include "figures/excursion.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::bench {
namespace {

using namespace std::chrono_literals;

constexpr int kTurns = 3000;
// The best of a few: an interrupt is nobody's share of a core.
constexpr int kTryCount = 3;
// Where the loops take no more than so much of each other's time, nobody else can be there.
constexpr double kSurelyAlone = 0.6;
constexpr Duration kPatience = 100ms;

double smallest_look = std::numeric_limits<double>::infinity();

// Twelve operations a turn, which need nothing of each other but in sixes.
Duration time_of_wide_loop() {
  std::uint64_t a = 1, b = 2, c = 3, d = 4, e = 5, f = 6;
  const MonotonicTime begin = rt::now();
  for (int i = 0; i < kTurns; ++i) {
    for (int half = 0; half < 2; ++half) {
      a += 1, b ^= 3, c += 5, d ^= 7, e += 1, f ^= 9;
      // So that the compiler keeps each.
      asm volatile("" : "+r"(a), "+r"(b), "+r"(c), "+r"(d), "+r"(e), "+r"(f));
    }
  }
  return rt::now() - begin;
}

// Two multiplications a turn, each of what the one before gave.
Duration time_of_narrow_loop() {
  std::uint64_t x = 3;
  const MonotonicTime begin = rt::now();
  for (int i = 0; i < kTurns; ++i) {
    x *= x;
    asm volatile("" : "+r"(x));
    x *= x;
    asm volatile("" : "+r"(x));
  }
  return rt::now() - begin;
}

double look_here() {
  Duration wide = Duration::max();
  Duration narrow = Duration::max();
  for (int i = 0; i < kTryCount; ++i) {
    wide = std::min(wide, time_of_wide_loop());
    narrow = std::min(narrow, time_of_narrow_loop());
  }
  const double share = static_cast<double>(wide.count()) / static_cast<double>(narrow.count());
  smallest_look = std::min(smallest_look, share);
  return share;
}

}  // namespace

double SharedCore::look(std::span<const int> cpus) {
  double most = 0;
  Excursion excursion;
  for (const int cpu : cpus) {
    if (excursion.go_to(cpu)) most = std::max(most, look_here());
  }
  return most;
}

double SharedCore::alone(std::span<const int> cpus) {
  static const bool has_looked = [&] {
    const MonotonicTime give_up = rt::now() + kPatience;
    while (rt::now() < give_up && smallest_look > kSurelyAlone) {
      static_cast<void>(look(cpus));
      rt::sleep_until(rt::now() + 2ms);
    }
    return true;
  }();
  static_cast<void>(has_looked);
  return smallest_look;
}

}  // namespace rtpm::bench
