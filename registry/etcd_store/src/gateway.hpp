#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "address.hpp"
#include "http.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/base/time.hpp"

namespace rtpm::etcd_store {

using Json = nlohmann::json;

/// Why etcd returned no result.
struct GatewayError {
  /// The gRPC codes that etcd returns.
  static constexpr int kNotFound = 5;
  static constexpr int kExhausted = 8;
  static constexpr int kOutOfRange = 11;
  static constexpr int kUnavailable = 14;
  std::string why{};
  int code = kUnavailable;
  bool was_sent = true;             ///< etcd may have carried out the request.
  bool is_lasting = false;          ///< The same endpoint would fail again in the same way.
  std::uint64_t other_cluster = 0;  ///< The id of the answering cluster, if it is another one.
};

/// A key's value, in etcd's form.
struct KeyValue {
  std::string key{};
  std::string value{};
  std::uint64_t mod_revision = 0;
  std::uint64_t lease = 0;
};

/// etcd's JSON gateway at any endpoint of a cluster.
/// @threads  any, concurrently
class Gateway {
 public:
  explicit Gateway(Address address)
      : address_(std::move(address)), other_clusters_(address_.endpoints.size()) {}

  [[nodiscard]] const Address& address() const noexcept { return address_; }
  /// Asks the preferred endpoint, then the others, until one answers or `deadline` passes. The
  /// request must be safe to send twice.
  [[nodiscard]] expected<Json, GatewayError> ask(std::string_view path, const Json& body,
                                                 MonotonicTime deadline);
  /// Asks one endpoint, and checks that it belongs to the cluster that answered first.
  [[nodiscard]] expected<Json, GatewayError> ask_at(std::size_t endpoint, std::string_view path,
                                                    const Json& body, Duration patience);
  /// Applies the same checks to a line of a stream.
  [[nodiscard]] expected<Json, GatewayError> parse(const std::string& text, long status);

  [[nodiscard]] std::string url(std::size_t endpoint, std::string_view path) const;
  /// The endpoint that is asked first.
  [[nodiscard]] std::size_t preferred() const noexcept { return preferred_; }
  /// Prefers the next endpoint, unless another caller has changed the preference.
  void avoid(std::size_t endpoint) noexcept;
  /// Notes that the endpoint answered as a member of the cluster `other`; 0 for the known one.
  void note_cluster(std::size_t endpoint, std::uint64_t other);
  /// Makes another cluster the known one once most endpoints belong to it: the cluster was
  /// replaced, for instance by restoring it under a new token. Returns whether it did.
  [[nodiscard]] bool adopt_other_cluster();
  /// The id of the known cluster; 0 until one has answered.
  [[nodiscard]] std::uint64_t cluster() const noexcept { return cluster_; }
  /// Aborts requests in progress.
  void stop() noexcept { is_stopping_ = true; }
  [[nodiscard]] bool is_stopping() const noexcept { return is_stopping_; }

 private:
  [[nodiscard]] std::unique_ptr<HttpClient> take_client();
  void give_back(std::unique_ptr<HttpClient> client);

  Address address_;
  std::atomic<std::size_t> preferred_ = 0;
  std::atomic<std::uint64_t> cluster_ = 0;
  std::atomic<bool> is_stopping_ = false;
  std::mutex mutex_;  ///< Not for real-time threads. Guards the members below.
  std::vector<std::unique_ptr<HttpClient>> idle_{};
  std::vector<std::uint64_t> other_clusters_;  ///< Indexed by endpoint; 0 if it has none.
};

/// Reads a whole number from etcd's JSON, which writes 64-bit numbers as text and omits zeros.
[[nodiscard]] std::uint64_t number_at(const Json& json, const char* key);
/// A member object; null if there is none.
[[nodiscard]] const Json& object_at(const Json& json, const char* key);
/// @return nullopt if `json` is not a key with a value
[[nodiscard]] std::optional<KeyValue> key_value_of(const Json& json);

}  // namespace rtpm::etcd_store
