#include "report.hpp"

#include "rtpm/driver/vector.hpp"
#include "rtpm/program/text.hpp"

namespace rtpm::servo {
namespace {

using program::formatted;

double to_us(Duration duration) {
  return std::chrono::duration<double, std::micro>(duration).count();
}

double percent(std::uint64_t part, std::uint64_t whole) {
  return whole == 0 ? 0 : 100.0 * static_cast<double>(part) / static_cast<double>(whole);
}

std::string row(const char* name, const LatencyHistogram& histogram) {
  std::string line = formatted("  %-24s", name);
  for (const double share : {50.0, 90.0, 99.0, 99.9, 99.99}) {
    line += formatted(" %8.1f", to_us(histogram.percentile(share)));
  }
  return line + formatted(" %8.1f\n", to_us(histogram.max()));
}

}  // namespace

std::string live_text(const Live& live, const LatencyHistogram& cycles, Duration since_start) {
  const driver::Vector3& at = live.sample.pose.position_m;
  std::string line =
      formatted("%6.1f s  at %+6.1f %+6.1f %+6.1f mm  force %5.2f N  %-7s  p50 %5.1f us",
                std::chrono::duration<double>(since_start).count(), at.x * 1e3, at.y * 1e3,
                at.z * 1e3, length(live.force_newton), live.depth_m > 0 ? "contact" : "free",
                to_us(cycles.percentile(50)));
  if (live.failed_count > 0) {
    line += formatted("  failed calls %llu", static_cast<unsigned long long>(live.failed_count));
  }
  if (!live.sample.faults.empty()) line += "  " + driver::to_text(live.sample.faults);
  return line;
}

std::string feel_text(const Feel& feel, const LoopConfig& config) {
  std::string line = formatted("  the %s of %.0f N/m, rendered ",
                               std::string(to_string(config.wall.shape)).c_str(),
                               config.wall.stiffness_newton_per_m);
  if (config.is_local) {
    line += "in the device's loop";
  } else {
    line += "by this program";
    if (config.delay > Duration{0}) {
      line += formatted(" with %.1f ms of delay each way", to_us(config.delay) / 1e3);
    }
  }
  if (feel.depth_m_max() <= 0) return line + ": not touched\n";
  return line + formatted(": felt as %.0f N/m, entered by %.2f mm at most\n",
                          feel.stiffness_newton_per_m(), feel.depth_m_max() * 1e3);
}

std::string table_text(const Statistics& statistics) {
  std::string table = formatted("  %-24s %8s %8s %8s %8s %8s %8s\n", "latency in us", "p50", "p90",
                                "p99", "p99.9", "p99.99", "max");
  table += row("one call: read", statistics.read);
  // A wall that the device renders needs no commands.
  const bool is_watching = statistics.command.count() == 0 && statistics.read.count() > 0;
  if (!is_watching) table += row("one call: command", statistics.command);
  table += row(is_watching ? "one cycle of one call" : "one cycle of two calls", statistics.cycle);
  table += row("begun late by", statistics.lateness);
  table += formatted(
      "  cycles %llu   missed deadlines %llu   failed calls %llu   in contact %.0f %%   "
      "greatest force %.2f N\n",
      static_cast<unsigned long long>(statistics.cycle_count),
      static_cast<unsigned long long>(statistics.missed_count),
      static_cast<unsigned long long>(statistics.failed_count),
      percent(statistics.contact_count, statistics.cycle_count), statistics.force_newton_max);
  table += formatted("\n  The paper, one node, single calls of 48 bytes:      here\n");
  table += formatted(
      "    91 %% of calls took 58 us (Timesys)               %.1f %% of calls within 58 us\n",
      percent(statistics.call_within_paper_count, statistics.call_count));
  table += formatted(
      "    99.8 %% of calls within 1 ms (Linux, Windows)     %.2f %% of whole cycles within "
      "1 ms\n",
      percent(statistics.cycle_within_paper_count, statistics.cycle_count));
  table += "    A network between the nodes added about 110 us to a call, at most 200 us.\n";
  return table;
}

}  // namespace rtpm::servo
