#pragma once

#include <nanobind/nanobind.h>

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "forking.hpp"
#include "node.hpp"
#include "rtpm/rpc/async.hpp"
#include "rtpm/rpc/binding.hpp"
#include "schema.hpp"

namespace rtpm::python {

/// Inherited by calls that give no priority, deadline or trace of their own.
struct CallScope {
  std::optional<Priority> priority{};
  MonotonicTime deadline = kNever;
  /// The deadline replaces those of the methods, instead of only shortening them.
  bool replaces_deadlines = false;
  std::uint64_t trace_id = 0;
};

/// The channels of event loops' calls at one priority.
struct Channels {
  std::size_t used_count = 0;
  std::size_t open_count = 0;  ///< The most that were in use at once since one was lost.
};

/// @errors raises ValueError, with the range
[[nodiscard]] Priority priority_of(int priority);
/// The options of a call outside any scope.
/// @errors raises ValueError, with the range
[[nodiscard]] rpc::CallOptions options_of(std::optional<int> priority,
                                          std::optional<double> deadline);

class Stream;

/// A bound object.
/// @ownership keeps its node and schema
/// @threads   with the GIL
class Binding {
 public:
  /// @errors raises the exception of rpc::Binding::bind()
  Binding(SharedNode node, nanobind::object schema, std::size_t service, std::string target,
          std::optional<double> deadline);

  [[nodiscard]] nanobind::object call(std::size_t index, nanobind::handle request,
                                      std::optional<int> priority, std::optional<double> deadline,
                                      const CallScope* scope);
  /// Calls with each request, several at a time.
  [[nodiscard]] nanobind::list call_many(std::size_t index, nanobind::handle requests,
                                         std::optional<int> priority,
                                         std::optional<double> deadline, const CallScope* scope);
  [[nodiscard]] std::unique_ptr<Stream> open_stream(std::size_t index, nanobind::handle request,
                                                    std::optional<int> priority,
                                                    std::optional<double> deadline,
                                                    const CallScope* scope, std::uint32_t window);
  /// The options of a call.
  /// @errors raises ValueError, with the range
  [[nodiscard]] rpc::CallOptions options(std::size_t index, std::optional<int> priority,
                                         std::optional<double> deadline,
                                         const CallScope* scope) const;
  /// @errors as Codec::encode(), and raises TooLarge: larger than the method's `rtpm_max_size`
  [[nodiscard]] std::vector<std::byte> encode(std::size_t index, nanobind::handle request);
  /// Sends a call, and does not wait for its reply. If no channel is open that is free, it opens one
  /// first, which may take until the deadline.
  /// @threads any
  [[nodiscard]] expected<rpc::PendingReply, rpc::CallError> start(std::size_t index,
                                                                  ConstBytes request,
                                                                  const rpc::CallOptions& options);
  /// How long a call of the method lasts at most.
  [[nodiscard]] Duration deadline_of(std::size_t index, const rpc::CallOptions& options) const;

  [[nodiscard]] const schema::Method& method(std::size_t index) const {
    return service_.methods.at(index);
  }
  [[nodiscard]] nanobind::object decode(std::size_t index, ConstBytes reply) const {
    return schema_.codec().decode(method(index).reply, reply);
  }
  [[noreturn]] void fail(std::size_t index, rpc::CallError error);

  [[nodiscard]] Channels& channels_of(const rpc::CallOptions& options) {
    return channels_[options.priority ? int{options.priority->value()} : -1];
  }

  [[nodiscard]] std::string url() const;
  [[nodiscard]] std::string_view transport() const noexcept;
  [[nodiscard]] const std::string& target() const noexcept { return target_; }
  /// The clock offset to the server, and its uncertainty, in seconds.
  [[nodiscard]] nanobind::tuple ping(std::optional<double> deadline);

 private:
  [[nodiscard]] rpc::PendingReply begin(std::size_t index, ConstBytes request,
                                        const rpc::CallOptions& options);
  [[nodiscard]] nanobind::object finish(std::size_t index, rpc::PendingReply& pending);
  void send(std::size_t index, ConstBytes request, const rpc::CallOptions& options);

  SharedNode node_;
  nanobind::object schema_object_;
  Schema& schema_;
  const schema::Service& service_;
  const rpc::InterfaceDescriptor& interface_;
  std::string target_;
  Unforked<rpc::Binding> binding_{};
  /// The last call succeeded, through shared memory.
  bool is_quick_ = false;
  std::map<int, Channels> channels_{};  ///< By priority; -1 is the default.
};

}  // namespace rtpm::python
