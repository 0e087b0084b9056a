#include "rtpm/events/hub_report.hpp"

#include <cstdio>
#include <string>
#include <vector>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "cli/table.hpp"
#include "events/commands.hpp"
#include "rtpm/events/defaults.hpp"
#include "rtpm/program/text.hpp"

namespace rtpm::tool {
namespace {

using events::HubConsumer;
using program::formatted;

struct ConsumersRequest {
  std::string hub{events::kHubPath};
  bool is_watch = false;
};

constexpr Duration kConsumersPeriod = std::chrono::seconds{1};
constexpr std::size_t kConsumerTextCount = 3;

double consumer_seconds(Duration time) {
  return std::chrono::duration<double>(time).count();
}

std::string consumer_time(Duration time) {
  const double s = consumer_seconds(time);
  if (s < 1) return formatted("%.1f ms", s * 1e3);
  if (s < 600) return formatted("%.1f s", s);
  return s < 2 * 3600 ? formatted("%.0f min", s / 60) : formatted("%.1f h", s / 3600);
}

double consumer_rate(const HubConsumer& consumer) {
  const double s = consumer_seconds(consumer.age);
  return s > 0 ? static_cast<double>(consumer.accepted_count) / s : 0;
}

Row consumer_row(const HubConsumer& consumer) {
  std::string program = consumer.program;
  if (consumer.process != 0) program += " " + std::to_string(consumer.process);
  return {consumer.name,
          program.empty() ? "unknown" : program,
          consumer.host,
          consumer_time(consumer.lag),
          std::to_string(consumer.lost_count),
          std::to_string(consumer.waiting_count),
          formatted("%.1f", consumer_rate(consumer)),
          consumer_time(consumer.age),
          std::string(consumer.is_suspended ? "suspended" : consumer.way)};
}

std::string consumers_text(const std::vector<HubConsumer>& consumers) {
  std::vector<Row> rows{
      {"CONSUMER", "PROGRAM", "HOST", "LAG", "LOST", "WAITING", "EVENTS/S", "SINCE", "BY"}};
  for (const HubConsumer& consumer : consumers)
    rows.push_back(consumer_row(consumer));
  return rows.size() == 1 ? "the hub has no consumers\n" : aligned(rows, kConsumerTextCount);
}

Json consumers_json(const std::vector<HubConsumer>& consumers) {
  Json list = Json::array();
  for (const HubConsumer& consumer : consumers) {
    list.push_back({{"name", consumer.name},
                    {"program", consumer.program},
                    {"process", consumer.process},
                    {"host", consumer.host},
                    {"lag_ns", consumer.lag.count()},
                    {"lost_count", consumer.lost_count},
                    {"waiting_count", consumer.waiting_count},
                    {"accepted_count", consumer.accepted_count},
                    {"age_s", consumer_seconds(consumer.age)},
                    {"way", consumer.way},
                    {"is_suspended", consumer.is_suspended}});
  }
  return list;
}

int consumers(Context& context, const ConsumersRequest& request) {
  const Duration deadline = context.deadline.value_or(std::chrono::seconds{1});
  do {
    const auto report = events::HubReport::ask(context.node(), request.hub, deadline);
    if (!report) return context.not_reached(named(request.hub, report.error()));
    if (context.json) {
      print_json(consumers_json(report->consumers));
      continue;
    }
    // Clears the screen and draws from the top.
    std::printf("%s%s", request.is_watch && is_terminal() ? "\x1b[H\x1b[2J" : "",
                consumers_text(report->consumers).c_str());
    std::fflush(stdout);
  } while (request.is_watch && !context.stop().wait_for(kConsumersPeriod));
  return kDone;
}

}  // namespace

void add_consumers(CLI::App& program, Context& context) {
  const auto request = std::make_shared<ConsumersRequest>();
  CLI::App& command = add_command(
      program, context, "consumers", "Show a hub's consumers, those furthest behind first",
      "  rtpm consumers --watch\n"
      "LAG: how late events reach the program, at most in the last second; more than 3 s: it does\n"
      "not take any. LOST: events that its filter accepted and it did not get. HOST: the address\n"
      "that it subscribed from. EVENTS/S: since it subscribed.\n",
      [request](Context& c) { return consumers(c, *request); });
  command.add_option("--hub", request->hub, "The hub, by name or URL")->capture_default_str();
  command.add_flag("--watch", request->is_watch, "Again each second, until Ctrl-C");
}

}  // namespace rtpm::tool
