#include "live/hub_report.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

#include "rtpm/rt/clock.hpp"

namespace rtpm::console {

using Json = nlohmann::ordered_json;

HubReportView HubReport::look() {
  HubReportView view;
  auto report = events::HubReport::ask(node_, hub_);
  if (!report) {
    before_ = MonotonicTime{};
    return view;
  }
  view.consumers = std::move(report->consumers);
  const std::uint64_t taken_count = report->taken_count;
  const MonotonicTime now = rt::now();
  if (before_ != MonotonicTime{} && taken_count >= taken_count_) {
    view.event_per_s = static_cast<double>(taken_count - taken_count_) /
                       std::chrono::duration<double>(now - before_).count();
  }
  before_ = now;
  taken_count_ = taken_count;
  return view;
}

Json consumers_json(const std::vector<events::HubConsumer>& consumers) {
  Json list = Json::array();
  for (std::size_t i = 0; i < std::min(consumers.size(), kShownConsumerMax); ++i) {
    const events::HubConsumer& one = consumers[i];
    const double age_s = std::chrono::duration<double>(one.age).count();
    list.push_back(
        {{"name", one.name},
         {"program",
          one.process == 0 ? one.program : one.program + " " + std::to_string(one.process)},
         {"host", one.host},
         {"way", one.way},
         {"lag_ms", std::chrono::duration<double, std::milli>(one.lag).count()},
         {"waiting", one.waiting_count},
         {"delivered_per_s", age_s > 0 ? static_cast<double>(one.accepted_count) / age_s : 0},
         {"dropped_count", one.lost_count},
         {"is_suspended", one.is_suspended}});
  }
  return list;
}

}  // namespace rtpm::console
