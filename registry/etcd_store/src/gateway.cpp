#include "gateway.hpp"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <utility>

#include "base64.hpp"
#include "rtpm/base/nesting.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::etcd_store {
namespace {

using namespace std::chrono_literals;

// Bounds one endpoint's share of the time, so that a hanging one leaves time for the next.
constexpr Duration kPatienceMin = 100ms;
// Pause before all endpoints are asked again: an election takes one or two seconds.
constexpr Duration kRoundPause = 50ms;

/// Whether another endpoint may succeed after an answer with this code.
bool is_passing(int code) noexcept {
  constexpr int kCancelled = 1;
  constexpr int kUnknown = 2;
  constexpr int kDeadlineExceeded = 4;
  return code == GatewayError::kUnavailable || code == kDeadlineExceeded || code == kCancelled ||
         code == kUnknown;
}

/// Formats: {"error": "…", "code": 14}; in a stream {"error": {"grpc_code": 14, "message": "…"}}.
std::optional<GatewayError> error_of(const Json& json) {
  const auto error = json.find("error");
  if (error == json.end()) return std::nullopt;
  const Json& holder = error->is_object() ? *error : json;
  const Json code = holder.value(error->is_object() ? "grpc_code" : "code", Json());
  const Json message = holder.value(holder.contains("message") ? "message" : "error", Json());
  return GatewayError{printable(message.is_string() ? message.get<std::string>() : "an error"),
                      code.is_number_integer() ? code.get<int>() : GatewayError::kUnavailable};
}

GatewayError lasting(std::string why) {
  return {.why = std::move(why), .is_lasting = true};
}
GatewayError no_etcd(long status) {
  return lasting("it answers with what is no JSON of etcd, status " + std::to_string(status));
}

}  // namespace

std::uint64_t number_at(const Json& json, const char* key) {
  const auto found = json.is_object() ? json.find(key) : json.end();
  if (found == json.end()) return 0;
  if (found->is_number_unsigned()) return found->get<std::uint64_t>();
  if (!found->is_string()) return 0;
  const auto& text = found->get_ref<const std::string&>();
  std::uint64_t number = 0;
  static_cast<void>(std::from_chars(text.data(), text.data() + text.size(), number));
  return number;
}

const Json& object_at(const Json& json, const char* key) {
  static const Json kNone;
  const auto found = json.is_object() ? json.find(key) : json.end();
  return found == json.end() ? kNone : *found;
}

std::optional<KeyValue> key_value_of(const Json& json) {
  const auto text_at = [&](const char* name) -> std::optional<std::string> {
    const Json& text = object_at(json, name);
    if (text.is_null()) return std::string();
    return text.is_string() ? from_base64(text.get_ref<const std::string&>()) : std::nullopt;
  };
  auto key = text_at("key");
  auto value = text_at("value");
  const std::uint64_t revision = number_at(json, "mod_revision");
  if (!key || !value || key->empty() || revision == 0) return std::nullopt;
  return KeyValue{std::move(*key), std::move(*value), revision, number_at(json, "lease")};
}

std::string Gateway::url(std::size_t endpoint, std::string_view path) const {
  return "http://" + address_.endpoints[endpoint] + std::string(path);
}

void Gateway::avoid(std::size_t endpoint) noexcept {
  std::size_t expected = endpoint;
  preferred_.compare_exchange_strong(expected, (endpoint + 1) % address_.endpoints.size());
}

std::unique_ptr<HttpClient> Gateway::take_client() {
  const std::lock_guard lock(mutex_);
  if (idle_.empty()) return std::make_unique<HttpClient>(is_stopping_);
  auto client = std::move(idle_.back());
  idle_.pop_back();
  return client;
}

void Gateway::give_back(std::unique_ptr<HttpClient> client) {
  const std::lock_guard lock(mutex_);
  idle_.push_back(std::move(client));
}

expected<Json, GatewayError> Gateway::parse(const std::string& text, long status) {
  Json json = parse_bounded_json<Json>(text);
  if (!json.is_object()) {
    return unexpected{no_etcd(status)};
  }
  if (auto error = error_of(json)) return unexpected{std::move(*error)};
  Json result = json.contains("result") ? std::move(json["result"]) : std::move(json);
  const std::uint64_t cluster = number_at(object_at(result, "header"), "cluster_id");
  if (cluster == 0) {
    return unexpected{no_etcd(status)};
  }
  std::uint64_t known = 0;
  if (!cluster_.compare_exchange_strong(known, cluster) && known != cluster) {
    auto error = lasting("it is of another cluster than the others");
    error.other_cluster = cluster;
    return unexpected{std::move(error)};
  }
  return result;
}

expected<Json, GatewayError> Gateway::ask_at(std::size_t endpoint, std::string_view path,
                                             const Json& body, Duration patience) {
  if (is_stopping_) return unexpected{GatewayError{"the registry ends"}};
  auto client = take_client();
  const auto reply = client->post(url(endpoint, path), body.dump(), patience);
  give_back(std::move(client));
  if (!reply) {
    return unexpected{GatewayError{reply.error().why, GatewayError::kUnavailable,
                                   reply.error().was_sent, reply.error().is_lasting}};
  }
  auto result = parse(reply->body, reply->status);
  note_cluster(endpoint, result ? 0 : result.error().other_cluster);
  return result;
}

void Gateway::note_cluster(std::size_t endpoint, std::uint64_t other) {
  const std::lock_guard lock(mutex_);
  other_clusters_[endpoint] = other;
}

bool Gateway::adopt_other_cluster() {
  const std::lock_guard lock(mutex_);
  for (const std::uint64_t other : other_clusters_) {
    if (other == 0) continue;
    const auto count = static_cast<std::size_t>(std::ranges::count(other_clusters_, other));
    if (2 * count <= other_clusters_.size()) continue;
    cluster_ = other;
    std::ranges::fill(other_clusters_, 0);
    return true;
  }
  return false;
}

expected<Json, GatewayError> Gateway::ask(std::string_view path, const Json& body,
                                          MonotonicTime deadline) {
  std::vector<std::string> why_of(address_.endpoints.size());
  bool was_sent = false;
  std::size_t lasting_count = 0;  // Lasting errors in this round.
  const auto failed = [&] {
    std::string why;
    for (std::size_t i = 0; i < why_of.size(); ++i) {
      if (!why_of[i].empty())
        why += (why.empty() ? "" : "; ") + address_.endpoints[i] + ": " + why_of[i];
    }
    return unexpected{
        GatewayError{why.empty() ? "no time was left" : why, GatewayError::kUnavailable, was_sent}};
  };
  for (std::size_t attempt = 0; !is_stopping_; ++attempt) {
    const std::size_t endpoint = preferred_;
    const Duration left = deadline - rt::now();
    if (left <= Duration{0}) break;
    auto reply = ask_at(endpoint, path, body, std::min(left, std::max(left / 2, kPatienceMin)));
    if (reply) return reply;
    GatewayError& error = reply.error();
    was_sent = was_sent || error.was_sent;
    error.was_sent = was_sent;
    if (!is_passing(error.code)) {
      error.why = address_.endpoints[endpoint] + ": " + error.why;
      return reply;
    }
    // An attempt cut off by the deadline explains less than an earlier one: keep the earlier
    // reason.
    if (why_of[endpoint].empty() || rt::now() < deadline) why_of[endpoint] = error.why;
    lasting_count += error.is_lasting ? 1 : 0;
    avoid(endpoint);
    if ((attempt + 1) % address_.endpoints.size() != 0) continue;
    const bool is_in_vain = std::exchange(lasting_count, 0) == address_.endpoints.size();
    if (is_in_vain || rt::now() + kRoundPause >= deadline) break;
    rt::sleep_until(rt::now() + kRoundPause);
  }
  return failed();
}

}  // namespace rtpm::etcd_store
