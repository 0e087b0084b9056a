#include "rtpm/rpc/binding.hpp"

#include <string>

#include "client/bind_attempt.hpp"
#include "client/binding_impl.hpp"
#include "client/node_impl.hpp"
#include "client/rebinder.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::rpc {
namespace {

expected<std::string, SetupError> url_of(Node& node, std::string_view target,
                                         MonotonicTime deadline) {
  if (wire::is_url(target)) return std::string(target);
  if (node.impl().resolver() == nullptr) {
    return setup_error("name '" + std::string(target) + "' can't be resolved",
                       "this program uses no registry",
                       "give a URL such as rtpm://127.0.0.1:4711/lab/arm0, or a resolver "
                       "(Node::use)");
  }
  return node.impl().resolver()->resolve(target, deadline);
}

}  // namespace

expected<Binding, SetupError> Binding::bind(Node& node, std::string_view target,
                                            const InterfaceDescriptor& interface,
                                            const BindOptions& options) {
  const MonotonicTime deadline = deadline_after(options.deadline, rt::now());
  const auto url = url_of(node, target, deadline);
  if (!url) return unexpected{url.error()};
  auto impl = std::make_unique<Impl>(node, interface, options,
                                     std::string(wire::is_url(target) ? "" : target));
  if (auto bound = impl->bind(*url, deadline); !bound) return unexpected{std::move(bound.error())};
  return Binding(std::move(impl));
}

Binding::Impl::Impl(Node& node, const InterfaceDescriptor& interface, const BindOptions& options,
                    std::string name)
    : node_(node),
      options_(options),
      interface_(interface),
      default_deadline_(node.config().default_deadline),
      name_(std::move(name)) {}

Binding::Impl::~Impl() {
  if (follows()) node_.impl().rebinder().remove(*this);
}

expected<void, SetupError> Binding::Impl::bind(const std::string& url, MonotonicTime deadline) {
  auto opened = BindAttempt(node_, interface_, options_, std::nullopt, url).open(deadline);
  if (!opened) return unexpected{std::move(opened.error())};
  destinations_.settle(std::move(opened->destination), opened->bound);
  if (!follows()) return {};
  return node_.impl().rebinder().add(*this);
}

expected<void, SetupError> Binding::Impl::warm_up(std::span<const Priority> priorities) {
  const Destinations::Pin pin(destinations_);
  const Destination& at = *destinations_.get().destination;
  if (at.door && !priorities.empty()) at.door->open_places(priorities);
  SetupError transport_error;
  const auto warm = at.endpoint.warm_up(priorities, deadline_after(default_deadline_, rt::now()),
                                        transport_error);
  if (warm) return {};
  return unexpected{
      explain_bind({.error = warm.error()}, interface_, at.path, at.url, transport_error)};
}

Binding::Binding(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
Binding::Binding(Binding&&) noexcept = default;
Binding& Binding::operator=(Binding&&) noexcept = default;
Binding::~Binding() = default;

expected<void, SetupError> Binding::warm_up(std::span<const Priority> priorities) {
  return impl_->warm_up(priorities);
}

std::string Binding::url() const {
  const Destinations::Pin pin(impl_->destinations());
  return impl_->destinations().get().destination->url;
}

std::uint64_t Binding::server_epoch() const noexcept {
  return impl_->destinations().get().server_epoch;
}

Transport Binding::transport() const noexcept {
  const Destinations::Pin pin(impl_->destinations());
  const Destination& at = *impl_->destinations().get().destination;
  return at.door ? Transport::kLocal : at.endpoint.address().transport;
}

FollowStatus Binding::follow_status() const {
  return impl_->follow_status();
}

}  // namespace rtpm::rpc
