#include "history/history_desk.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numbers>
#include <span>

#include "channels/event_channels.hpp"
#include "rtpm/capture/channels.hpp"
#include "rtpm/gvd/device_event.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/utc.hpp"

namespace rtpm::console {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kQuerySizeMax = 200;
constexpr std::size_t kFoundCountMax = 500;
constexpr std::size_t kAskedCountMax = 64;
constexpr std::size_t kPointCountMax = 1500;
constexpr std::size_t kPlanCountMax = 4096;
/// How long a source without room waits before it asks again.
constexpr Duration kRefusedTime = std::chrono::minutes{1};

/// The 7 digits that a float has, so that the text does not get longer than the number.
double rounded(float value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.7g", static_cast<double>(value));
  return std::strtod(text.data(), nullptr);
}

std::optional<double> number_of(const nlohmann::json& request, const char* key) {
  const auto found = request.find(key);
  if (found == request.end() || !found->is_number()) return std::nullopt;
  const auto value = found->get<double>();
  // Beyond, it would not fit into 64 bits.
  return std::abs(value) < 9e18 ? std::optional(value) : std::nullopt;
}

std::optional<std::size_t> first_of(const HistoryTopic& topic, std::string_view name) {
  const auto found =
      std::ranges::find_if(topic.fields, [&](const auto& field) { return field.name == name; });
  if (found == topic.fields.end()) return std::nullopt;
  return static_cast<std::size_t>(found - topic.fields.begin());
}

bool senses_turn(const driver::Descriptor& descriptor) {
  return std::ranges::any_of(descriptor.axes, [](const driver::Axis& axis) {
    return axis.is_sensed && axis.name.starts_with('r');
  });
}

/// Where the -z axis of an orientation points, in degrees to the right and up, as on the page.
std::pair<double, double> direction_deg(const double* xyzw) {
  const auto [x, y, z, w] = std::array{xyzw[0], xyzw[1], xyzw[2], xyzw[3]};
  const double right = -2 * (x * z + w * y);
  const double up = -2 * (y * z - w * x);
  const double ahead = 1 - 2 * (x * x + y * y);
  constexpr double kDegrees = 180 / std::numbers::pi;
  return {kDegrees * std::atan2(right, ahead), kDegrees * std::atan2(up, std::hypot(right, ahead))};
}

}  // namespace

void HistoryDesk::start() {
  router_.add_json("console/fields", [this](const PendingCall& call, const auto& request) {
    answer_fields(call, request);
  });
  router_.add_json("console/history", [this](const PendingCall& call, const auto& request) {
    answer_history(call, request);
  });
}

void HistoryDesk::set_descriptor(const std::string& device,
                                 std::shared_ptr<const driver::Descriptor> descriptor) {
  if (descriptors_.size() >= kPlanCountMax && !descriptors_.contains(device)) descriptors_.clear();
  descriptors_[device] = std::move(descriptor);
}

HistoryDesk::Reader HistoryDesk::reader_of(const events::EventDescriptor& type,
                                           const driver::Descriptor* descriptor) {
  auto& [schema_id, shared] = readers_[type.type];
  if (descriptor == nullptr && shared && schema_id == type.schema_id) return shared;
  auto reader = exports::ScalarReader::create(std::string(type.schema), type.name, descriptor,
                                              exports::ScalarReader::Form::kWire);
  if (!reader) return nullptr;
  auto made = std::make_shared<const exports::ScalarReader>(std::move(*reader));
  if (descriptor == nullptr) {
    schema_id = type.schema_id;
    shared = made;
  }
  return made;
}

HistoryDesk::Plan HistoryDesk::plan_for(const HubEvent& event, const events::EventDescriptor& type,
                                        const std::string* device,
                                        std::shared_ptr<const driver::Descriptor> descriptor) {
  Plan plan{.schema_id = type.schema_id, .descriptor = std::move(descriptor)};
  plan.made = event.arrived;
  const driver::Descriptor* const parts = plan.descriptor.get();
  if (device == nullptr) {
    plan.topic.name = std::string(type.name) + "/" + std::to_string(event.header.source);
  } else {
    plan.topic.name = capture::device_topic(*device, type.name);
    plan.topic.device = *device;
  }
  plan.reader = reader_of(type, parts);
  if (!plan.reader) return plan;
  for (const exports::ScalarField& field : plan.reader->fields())
    plan.topic.fields.push_back({field.path, field.unit});
  if (parts != nullptr && senses_turn(*parts)) {
    plan.orientation = first_of(plan.topic, "orientation.x");
    if (plan.orientation) {
      plan.topic.fields.push_back({"direction_deg.right", "°"});
      plan.topic.fields.push_back({"direction_deg.up", "°"});
    }
  }
  if (parts != nullptr && parts->limits.force_newton_max > 0) {
    plan.force = first_of(plan.topic, "force_newton.x");
    if (plan.force) plan.topic.fields.push_back({"force_newton.total", "N"});
  }
  plan.values.resize(plan.topic.fields.size());
  if (plan.topic.fields.empty() || !history_.add(plan.topic)) plan.reader = nullptr;
  return plan;
}

HistoryDesk::Plan* HistoryDesk::plan_of(const HubEvent& event, const std::string* device) {
  const events::EventDescriptor* const type = types_ ? types_->find(event.header.type) : nullptr;
  if (type == nullptr || type->schema_id != event.header.schema_id) return nullptr;
  std::shared_ptr<const driver::Descriptor> descriptor;
  if (event.header.type == gvd::kSampled) {
    const auto found = device == nullptr ? descriptors_.end() : descriptors_.find(*device);
    if (found == descriptors_.end()) return nullptr;
    descriptor = found->second;
  }
  const std::pair key{event.header.type, event.header.source};
  const auto known = plans_.find(key);
  const std::string device_name = device == nullptr ? "" : *device;
  if (known != plans_.end()) {
    Plan& plan = known->second;
    const bool is_current = plan.schema_id == type->schema_id && plan.descriptor == descriptor &&
                            plan.topic.device == device_name;
    if (plan.reader && is_current) return &plan;
    if (is_current && event.arrived - plan.made < kRefusedTime) return nullptr;
  } else if (plans_.size() >= kPlanCountMax) {
    plans_.clear();
  }
  Plan& plan = plans_.insert_or_assign(key, plan_for(event, *type, device, std::move(descriptor)))
                   .first->second;
  return plan.reader ? &plan : nullptr;
}

void HistoryDesk::take(const HubEvent& event, const std::string* device) {
  if (event.stream == EventStream::kLog || event.header.is_replayed) return;
  Plan* const plan = plan_of(event, device);
  if (plan == nullptr) return;
  const std::size_t count = plan->reader->fields().size();
  std::vector<double>& values = plan->values;
  if (!plan->reader->read(event.payload, std::span(values).first(count))) return;
  std::size_t next = count;
  if (plan->orientation) {
    const auto [right, up] = direction_deg(&values[*plan->orientation]);
    values[next++] = right;
    values[next++] = up;
  }
  if (plan->force) {
    const double* const force = &values[*plan->force];
    values[next++] = std::hypot(force[0], force[1], force[2]);
  }
  const auto time_ns = static_cast<std::int64_t>(log_time_ns(event));
  if (history_.put(plan->topic.name, time_ns, values)) return;
  // Forgotten meanwhile, when there were too many topics.
  if (history_.add(plan->topic)) {
    static_cast<void>(history_.put(plan->topic.name, time_ns, values));
  } else {
    plan->reader = nullptr;
    plan->made = event.arrived;
  }
}

void HistoryDesk::take_parameters(const std::string& object,
                                  const std::vector<NumericParameter>& parameters) {
  if (parameters.empty()) return;
  HistoryTopic topic{.name = object + "/config", .device = object};
  std::vector<double> values;
  for (const NumericParameter& parameter : parameters) {
    topic.fields.push_back({parameter.name, parameter.unit});
    values.push_back(parameter.value);
  }
  const auto now_ns = static_cast<std::int64_t>(rt::utc_ns(rt::now()));
  if (history_.has(topic) && history_.put(topic.name, now_ns, values)) return;
  if (history_.add(topic)) static_cast<void>(history_.put(topic.name, now_ns, values));
}

void HistoryDesk::follow_clock(MonotonicTime now) {
  history_.set_now(static_cast<std::int64_t>(rt::utc_ns(now)));
}

Json HistoryDesk::state() const {
  return {{"byte_count", history_.byte_count()},       {"byte_max", history_.byte_max()},
          {"field_count", history_.field_count()},     {"dropped_count", history_.dropped_count()},
          {"refused_count", history_.refused_count()}, {"future_count", history_.future_count()}};
}

void HistoryDesk::answer_fields(const PendingCall& call, const nlohmann::json& request) {
  std::string query;
  if (const auto found = request.find("query"); found != request.end() && found->is_string()) {
    query = found->get<std::string>();
  }
  if (query.size() > kQuerySizeMax) {
    return router_.fail(call, "`query` has more than 200 characters");
  }
  const double count = number_of(request, "count").value_or(kFoundCountMax);
  const auto count_max = static_cast<std::size_t>(std::clamp(count, 1.0, double{kFoundCountMax}));
  const History::Search search = history_.find(query, count_max);
  Json fields = Json::array();
  for (const History::Found& found : search.fields) {
    fields.push_back(
        {{"path", found.path},
         {"unit", found.unit},
         {"device", found.device},
         {"label", found.path.substr(found.path.find('.', found.path.rfind('/')) + 1)}});
  }
  router_.succeed(call, Json{{"fields", std::move(fields)}, {"total_count", search.total_count}});
}

void HistoryDesk::answer_history(const PendingCall& call, const nlohmann::json& request) {
  const auto fields = request.find("fields");
  if (fields == request.end() || !fields->is_array() || fields->empty() ||
      fields->size() > kAskedCountMax) {
    return router_.fail(call, "console/history needs `fields`: 1 to 64 paths of console/fields");
  }
  const auto now_ns = static_cast<std::int64_t>(rt::utc_ns(rt::now()));
  const std::optional<double> seconds = number_of(request, "seconds");
  const std::optional<double> begin = number_of(request, "begin_ns");
  const std::optional<double> end = number_of(request, "end_ns");
  if ((!seconds || *seconds <= 0 || *seconds > 1e6) && (!begin || !end || *begin >= *end)) {
    return router_.fail(call,
                        "console/history needs `seconds` before now, or `begin_ns` and `end_ns`");
  }
  const std::int64_t begin_ns = seconds ? now_ns - static_cast<std::int64_t>(*seconds * 1e9)
                                        : static_cast<std::int64_t>(*begin);
  const std::int64_t end_ns = seconds ? now_ns : static_cast<std::int64_t>(*end);
  const double points = number_of(request, "points").value_or(600);
  const auto point_max = static_cast<std::size_t>(std::clamp(points, 1.0, double{kPointCountMax}));
  Json columns = Json::array();
  for (const nlohmann::json& field : *fields) {
    if (!field.is_string()) return router_.fail(call, "`fields` has something else than paths");
    const auto path = field.get<std::string>();
    const auto column = history_.read(path, begin_ns, end_ns, point_max);
    Json steps = Json::array();
    Json low = Json::array();
    Json high = Json::array();
    const std::int64_t first_ns =
        column && !column->times_ns.empty() ? column->times_ns.front() : begin_ns;
    for (std::size_t i = 0; column && i < column->times_ns.size(); ++i) {
      steps.push_back((column->times_ns[i] - first_ns) / column->step_ns);
      low.push_back(rounded(column->spans[i].low));
      high.push_back(rounded(column->spans[i].high));
    }
    columns.push_back({{"path", path},
                       {"known", column.has_value()},
                       {"unit", column ? column->unit : ""},
                       {"first_ns", first_ns},
                       {"step_ns", column ? column->step_ns : 0},
                       {"steps", std::move(steps)},
                       {"low", std::move(low)},
                       {"high", std::move(high)}});
  }
  router_.succeed(
      call, Json{{"begin_ns", begin_ns}, {"end_ns", end_ns}, {"columns", std::move(columns)}});
}

}  // namespace rtpm::console
