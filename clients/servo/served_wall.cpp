#include "served_wall.hpp"

#include <utility>

#include "rtpm/configuration/client.hpp"

namespace rtpm::servo {
namespace {

/// A hand can't feel a wall below this; 0 would make choose_wall() choose.
constexpr double kStiffnessMin = 1;

unexpected<gvd::ConfigurationError> refused(gvd::ConfigurationOutcome outcome, SetupError words) {
  return {{outcome, {}, std::move(words)}};
}

}  // namespace

WallParameters::WallParameters(const Configuration& configuration, const driver::Descriptor& device,
                               const Wall& wall, Change change)
    : configuration_(configuration), device_(device), wall_(wall), change_(std::move(change)) {
  own_.device_class = device.device_class;
  own_.model = "rtpm-servo";
  own_.serial = configuration.device;
}

std::vector<driver::ParameterSpec> WallParameters::parameters() const {
  return {
      {.name = std::string(kStiffnessName),
       .unit = "N/m",
       .low = kStiffnessMin,
       .high = stiffness_bound_of(configuration_, device_, 0),
       .default_value = wall_.stiffness_newton_per_m,
       .description = "How stiff the wall is; with damping, less of it stays passive."},
      {.name = std::string(kDampingName),
       .unit = "N s/m",
       .low = 0,
       .high = device_.limits.damping_newton_s_per_m,
       .default_value = wall_.damping_newton_s_per_m,
       .description = "How much the wall brakes; it takes from the stiffness that is passive."}};
}

expected<void, gvd::ConfigurationError> WallParameters::apply(
    std::span<driver::ParameterSetting> settings, bool /*needs_inactive*/) {
  Configuration wanted = configuration_;
  wanted.wall = wall_;
  for (const driver::ParameterSetting& setting : settings) {
    double& field = setting.name == kStiffnessName ? wanted.wall.stiffness_newton_per_m
                                                   : wanted.wall.damping_newton_s_per_m;
    field = std::get<double>(setting.value);
  }
  auto wall = choose_wall(wanted, device_);
  if (!wall) {
    return refused(gvd::ConfigurationOutcome::kRefusedByDevice, std::move(wall.error()));
  }
  if (!change_(*wall)) {
    return refused(
        gvd::ConfigurationOutcome::kBusy,
        {"nothing was changed", "the loop had no time for it within 100 ms", "try again"});
  }
  wall_ = *wall;
  return {};
}

ServedWall::ServedWall(std::unique_ptr<WallParameters> parameters) noexcept
    : parameters_(std::move(parameters)) {}

ServedWall::~ServedWall() {
  // Unbinds the name first, so that no client finds a server that is about to end.
  name_.reset();
  if (server_) server_->stop();
}

expected<std::unique_ptr<ServedWall>, SetupError> ServedWall::create(
    rpc::Node& node, const Configuration& configuration, const driver::Descriptor& device,
    const Wall& wall, WallParameters::Change change) {
  std::unique_ptr<ServedWall> served(new ServedWall(
      std::make_unique<WallParameters>(configuration, device, wall, std::move(change))));
  const std::string what = "the wall's parameters can't be served as " + configuration.serve;
  auto manager = gvd::ConfigurationManager::create(*served->parameters_);
  if (!manager) return setup_error(what, std::move(manager.error()));
  served->manager_ = std::move(*manager);
  rpc::ServerConfig config{.name = "rtpm-servo", .realtime = rt::RealtimeMode::kOff};
  config.lanes = {{.name = "servo-config",
                   .wait = {.strategy = rt::WaitStrategy::kBlock},
                   .schedule = rt::Schedule::kTimeShared}};
  auto server = rpc::Server::create(std::move(config));
  if (!server) return setup_error(what, std::move(server.error()));
  served->server_ = std::move(*server);
  const std::string path = gvd::configuration_path(configuration.serve);
  rpc::Servant& servant = served->manager_->servant();
  served->catalog_.add(path, servant);
  if (auto added = served->server_->add(path, servant); !added) {
    return setup_error(what, std::move(added.error()));
  }
  if (auto added = served->server_->add(introspection::kPath, served->catalog_); !added) {
    return setup_error(what, std::move(added.error()));
  }
  if (auto started = served->server_->start(); !started) {
    return setup_error(what, std::move(started.error()));
  }
  auto name =
      names::Registration::create(node, configuration.registry, path, served->server_->url(path),
                                  std::string(servant.interface().name));
  if (!name) return setup_error(what, std::move(name.error()));
  served->name_ = std::move(*name);
  return served;
}

}  // namespace rtpm::servo
