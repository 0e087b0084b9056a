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

/// Whether the server was reached but will never serve this binding; only another server could.
[[nodiscard]] bool is_refusal(std::error_code cause) noexcept;

/// Explains why an object can't be bound at `url`.
/// @param transport_error  why the server could not be asked; empty if it was asked, or the outcome
///           says why
[[nodiscard]] SetupError explain_bind(const BindOutcome& outcome,
                                      const InterfaceDescriptor& interface, const std::string& path,
                                      const std::string& url,
                                      const SetupError& transport_error = {});

/// An attempt to bind the object at a URL. Tries its hosts and their addresses, the transports and
/// the keys of a known server in turn, and splits the remaining time among them.
/// @threads  one
/// @realtime set-up only
class BindAttempt {
 public:
  /// A destination that answers, with sessions for later calls.
  struct Opened {
    std::unique_ptr<Destination> destination;
    Bound bound{};
  };

  /// @param interface, options  must outlive this
  /// @param known  the fingerprint of the last bind; nullopt for the first bind
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
