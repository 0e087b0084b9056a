#pragma once

#include <memory>
#include <optional>
#include <string>
#include <system_error>

#include "client/destinations.hpp"
#include "client/object_check.hpp"
#include "rtpm/rpc/binding.hpp"
#include "security/server_address.hpp"

namespace rtpm::rpc {

/// When a caller's patience ends, which may be longer than all time that is left.
[[nodiscard]] MonotonicTime deadline_after(Duration patience, MonotonicTime now) noexcept;

/// Whether a server that was reached will not serve this binding: only another one could.
[[nodiscard]] bool is_refusal(std::error_code cause) noexcept;

/// Why an object can't be bound at `url`, in words.
/// @param transport_error  why the server was not asked; empty if it was, or the outcome says why
[[nodiscard]] SetupError explain_bind(const BindOutcome& outcome,
                                      const InterfaceDescriptor& interface, const std::string& path,
                                      const std::string& url,
                                      const SetupError& transport_error = {});

/// An attempt to bind the object at a URL: its hosts and their addresses, the transports and the
/// keys of a known server, one after the other, each with its part of the time that is left.
/// @threads  one
/// @realtime set-up only
class BindAttempt {
 public:
  /// A destination that answers, with sessions for the calls to come.
  struct Opened {
    std::unique_ptr<Destination> destination;
    Bound bound{};
  };

  /// @param interface, options  outlive this
  /// @param known  the fingerprint of the last bind; nothing at the first bind
  BindAttempt(Node& node, const InterfaceDescriptor& interface, const BindOptions& options,
              std::optional<std::uint64_t> known, std::string url);

  [[nodiscard]] expected<Opened, SetupError> open(MonotonicTime deadline);

 private:
  [[nodiscard]] ServerAddress address_of(const std::string& host, std::uint16_t port,
                                         MonotonicTime deadline) const;
  [[nodiscard]] expected<Opened, SetupError> open_at(const ServerCandidate& server,
                                                     MonotonicTime deadline);
  [[nodiscard]] expected<Opened, SetupError> open_over(const ServerAddress& address,
                                                       MonotonicTime deadline);
  [[nodiscard]] expected<Opened, SetupError> open_by(const ServerAddress& address,
                                                     MonotonicTime deadline);
  [[nodiscard]] expected<Bound, SetupError> open_session(Destination& at, MonotonicTime deadline);

  Node& node_;
  const InterfaceDescriptor& interface_;
  const BindOptions& options_;
  std::optional<std::uint64_t> known_;
  std::string url_;
  std::string path_{};
};

}  // namespace rtpm::rpc
