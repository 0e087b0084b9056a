#include "live/hub_report.hpp"

#include <nlohmann/json.hpp>

#include "rtpm/base/nesting.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::console {

using namespace nlohmann::literals;

HubReportView HubReport::look() {
  HubReportView view;
  if (!object_) {
    const auto url = names::url_of(node_, registry_, hub_);
    if (!url) return view;
    auto object = dynamic::RemoteObject::open(node_, *url);
    if (!object) return view;
    object_ = std::move(*object);
    before_ = MonotonicTime{};
  }
  std::string text;
  const auto called = object_->call("report", "", {}, std::nullopt, [&](std::string_view json) {
    text = json;
    return true;
  });
  const auto report = parse_bounded_json<nlohmann::json>(text);
  if (!called || !report.is_object()) {
    // Another hub may have taken over the name.
    object_.reset();
    return view;
  }
  view.consumer_count = report.value("subscriptions", nlohmann::json::array()).size();
  std::uint64_t taken_count = 0;
  for (const auto& supplier : report.value("suppliers", nlohmann::json::array())) {
    taken_count += supplier.value("/counts/taken"_json_pointer, std::uint64_t{0});
  }
  const MonotonicTime now = rt::now();
  if (before_ != MonotonicTime{} && taken_count >= taken_count_) {
    view.event_per_s = static_cast<double>(taken_count - taken_count_) /
                       std::chrono::duration<double>(now - before_).count();
  }
  before_ = now;
  taken_count_ = taken_count;
  return view;
}

}  // namespace rtpm::console
