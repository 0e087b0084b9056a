#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/expected.hpp"
#include "rtpm/rpc/binding.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/schema/dynamic.hpp"

namespace rtpm::tool {

/// An object of a server that tells its schema, callable without generated code.
/// Ownership: refers to its node, which must outlive it.   Threads: one.   Set-up only.
class RemoteObject {
 public:
  /// Asks the server at `url` for the schema of its object, and binds that.
  /// Errors, in words: nobody there, a server that tells nothing of itself, another compiler's
  /// schema.
  [[nodiscard]] static expected<std::unique_ptr<RemoteObject>, rpc::SetupError> open(
      rpc::Node& node, const std::string& url);

  [[nodiscard]] schema::Dynamic& dynamic() noexcept { return *dynamic_; }
  [[nodiscard]] const std::string& schema() const noexcept { return schema_; }
  [[nodiscard]] rpc::Binding& binding() noexcept { return *binding_; }

  /// Where the answer goes: the reply in JSON, or each item of a stream as it comes; while none
  /// comes, now and then an empty text. False: the stream is to end.
  using Print = std::function<bool(std::string_view json)>;

  /// Calls `method` with a request in JSON. A oneway has no answer; its caller waits as the schema
  /// says. A stream goes on until it ends, `print` wants no more, or `stream_time` is over.
  [[nodiscard]] expected<void, rpc::SetupError> call(std::string_view method, std::string_view json,
                                                     const rpc::CallOptions& options,
                                                     std::optional<Duration> stream_time,
                                                     const Print& print);

 private:
  RemoteObject() = default;
  [[nodiscard]] expected<void, rpc::SetupError> take_items(const schema::Method& method,
                                                           rpc::ItemReader& reader,
                                                           std::optional<Duration> stream_time,
                                                           const Print& print);
  [[nodiscard]] expected<void, rpc::SetupError> print_payload(const schema::Payload& payload,
                                                              ConstBytes bytes, bool& goes_on,
                                                              const Print& print);

  std::string schema_{};
  std::string compiler_version_{};
  std::unique_ptr<schema::Dynamic> dynamic_{};
  std::vector<rpc::MethodDescriptor> methods_{};
  rpc::InterfaceDescriptor interface_{};
  std::unique_ptr<rpc::Binding> binding_{};
};

/// The URL of a target that is a URL already, or a name in the registry at `registry_url`. Of a
/// name that is not bound the error has those that are most like it.
[[nodiscard]] expected<std::string, rpc::SetupError> url_of(rpc::Node& node,
                                                            const std::string& registry_url,
                                                            const std::string& target);

/// The URL of the catalog at the server of `url`; empty if that is no URL.
[[nodiscard]] std::string catalog_url(const std::string& url);

}  // namespace rtpm::tool
