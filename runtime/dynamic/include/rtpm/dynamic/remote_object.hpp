#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/rpc/binding.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/schema/dynamic.hpp"

namespace rtpm::dynamic {

/// An object as its server's catalog describes it. Its texts are untrusted.
/// @ownership a value
struct Description {
  std::string interface {};        ///< "lab.Arm".
  std::string schema{};            ///< See schema::schema_text().
  std::string compiler_version{};  ///< The version of the rtpmc that wrote it.
};

/// Fetches the description of the object at `url` from its server.
/// @realtime set-up only
/// @errors   no server, a server without a catalog, no such object
[[nodiscard]] expected<Description, SetupError> describe(rpc::Node& node, const std::string& url);

/// An object of a server that publishes its schema, callable without generated code.
/// @ownership refers to its node, which must outlive it
/// @threads  one
/// @realtime set-up only
class RemoteObject {
 public:
  /// Fetches the object's schema from the server at `url`, and binds the object.
  /// @errors  no server, a server without a catalog, a schema from another compiler
  [[nodiscard]] static expected<std::unique_ptr<RemoteObject>, SetupError> open(
      rpc::Node& node, const std::string& url);

  [[nodiscard]] schema::Dynamic& dynamic() noexcept { return *dynamic_; }
  [[nodiscard]] const std::string& schema() const noexcept { return schema_; }
  [[nodiscard]] const std::string& compiler_version() const noexcept { return compiler_version_; }
  [[nodiscard]] rpc::Binding& binding() noexcept { return *binding_; }

  /// Calls `method`, one of dynamic().service() without a stream, with wire bytes; returns the
  /// reply's, or none for a oneway. Without a deadline in `options`, the method's applies.
  /// @threads  any, concurrently, unlike the other methods
  /// @errors   those of rpc::Binding::call()
  [[nodiscard]] expected<std::vector<std::byte>, rpc::CallError> call_bytes(
      const schema::Method& method, ConstBytes request, const rpc::CallOptions& options);

  /// Receives the reply, or each item of a stream, as JSON; occasionally an empty text while no
  /// item arrives. Returns false to end the stream.
  using Print = std::function<bool(std::string_view json)>;

  /// Calls `method` with a JSON request. A oneway waits as its schema states. A stream lasts until
  /// it ends, `print` returns false, or `stream_time` is over.
  [[nodiscard]] expected<void, SetupError> call(std::string_view method, std::string_view json,
                                                const rpc::CallOptions& options,
                                                std::optional<Duration> stream_time,
                                                const Print& print);

 private:
  RemoteObject() = default;
  [[nodiscard]] expected<void, SetupError> take_items(const schema::Method& method,
                                                      rpc::ItemReader& reader,
                                                      std::optional<Duration> stream_time,
                                                      const Print& print);
  [[nodiscard]] expected<void, SetupError> print_payload(const schema::Payload& payload,
                                                         ConstBytes bytes, bool& goes_on,
                                                         const Print& print);

  std::string schema_{};
  std::string compiler_version_{};
  std::unique_ptr<schema::Dynamic> dynamic_{};
  std::vector<rpc::MethodDescriptor> methods_{};
  rpc::InterfaceDescriptor interface_{};
  std::unique_ptr<rpc::Binding> binding_{};
};

/// The URL of the catalog on the server of `url`; empty if `url` is malformed.
[[nodiscard]] std::string catalog_url(const std::string& url);

}  // namespace rtpm::dynamic
