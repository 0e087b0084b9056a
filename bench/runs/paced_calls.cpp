#include "runs/paced_calls.hpp"

#include "rtpm/rt/clock.hpp"

namespace rtpm::bench {

expected<void, std::string> call_paced(Caller& caller, Duration period, std::size_t count,
                                       CountFrom count_from, Samples& samples) {
  MonotonicTime due = rt::now() + period;
  for (std::size_t i = 0; i < count; ++i, due += period) {
    const bool is_late = rt::now() > due;
    if (!is_late) rt::sleep_until(due);
    const MonotonicTime begin = count_from == CountFrom::kDue || is_late ? due : rt::now();
    if (auto called = caller.echo(); !called) return called;
    samples.add(rt::now() - begin);
  }
  return {};
}

}  // namespace rtpm::bench
