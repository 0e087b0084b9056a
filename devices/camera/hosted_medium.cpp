#include "hosted_medium.hpp"

#include <algorithm>
#include <utility>
#include <vector>

#include "rtpm/configuration/client.hpp"
#include "rtpm/rt/clock.hpp"
#include "test_source.hpp"

namespace rtpm::camerad {
namespace {

/// How soon a pipeline is started again, and how often its bus is looked at.
constexpr Duration kPauseMin = std::chrono::milliseconds{500};
constexpr Duration kPauseMax = std::chrono::seconds{10};
constexpr Duration kLookInterval = std::chrono::milliseconds{100};

media::MediumDescriptionT description_of(const MediumSettings& settings) {
  media::MediumDescriptionT about;
  about.model = settings.model;
  about.serial = settings.serial;
  about.frame = settings.frame;
  return about;
}

driver::Descriptor descriptor_of(const MediumSettings& settings) {
  driver::Descriptor descriptor;
  descriptor.device_class = driver::DeviceClass::kInput;
  descriptor.model = settings.model;
  descriptor.serial = settings.serial;
  descriptor.frame = settings.frame;
  return descriptor;
}

}  // namespace

HostedMedium::HostedMedium(const Configuration& configuration, const MediumSettings& settings,
                           rpc::Node& node)
    : configuration_(configuration),
      settings_(settings),
      node_(node),
      name_(configuration.name_of(settings)),
      server_(description_of(settings)) {}

expected<std::unique_ptr<HostedMedium>, SetupError> HostedMedium::create(
    const Configuration& configuration, const MediumSettings& settings, rpc::Node& node) {
  std::unique_ptr<HostedMedium> medium(new HostedMedium(configuration, settings, node));
  auto pipeline = medium->make_pipeline();
  if (!pipeline) return setup_error(medium->name_, std::move(pipeline.error()));
  medium->pipeline_ = std::move(*pipeline);
  medium->is_camera_ = medium->pipeline_->element("video") != nullptr;
  medium->parameters_ = std::make_unique<Parameters>(*medium->pipeline_, descriptor_of(settings));
  auto manager = gvd::ConfigurationManager::create(
      *medium->parameters_, {.settings_folder = configuration.settings_folder});
  if (!manager) return setup_error(medium->name_, std::move(manager.error()));
  medium->manager_ = std::move(*manager);
  for (const std::string& ignored : medium->manager_->ignored())
    medium->log_.write(medium->name_ + ": " + ignored);
  return medium;
}

expected<std::unique_ptr<Pipeline>, SetupError> HostedMedium::make_pipeline() {
  return Pipeline::create(settings_.pipeline, settings_.uncertainty, server_);
}

expected<void, SetupError> HostedMedium::add_to(rpc::Server& server,
                                                introspection::Catalog& catalog) {
  const auto add = [&](const std::string& path, rpc::Servant& servant) {
    auto added = server.add(path, servant);
    if (added) catalog.add(path, servant);
    return added;
  };
  if (auto added = add(name_, server_); !added) return added;
  return add(gvd::configuration_path(name_), manager_->servant());
}

expected<void, SetupError> HostedMedium::start() {
  auto started = rt::Thread::start({.name = "rtpm-pipeline", .realtime = rt::RealtimeMode::kOff},
                                   [this] { run(); });
  if (!started) return unexpected{std::move(started.error())};
  thread_ = std::move(*started);
  return {};
}

expected<void, SetupError> HostedMedium::bind(rpc::Server& server) {
  if (configuration_.registry == kNoRegistry) return {};
  auto bound = names::Registration::create(
      node_, configuration_.registry, name_, server.url(name_),
      std::string(server_.interface().name), names::Registration::kDefaultLease, {},
      configuration_.allows_takeover ? names::Takeover::kAllowed : names::Takeover::kRefused,
      {{"class", is_camera_ ? "camera" : "microphone"},
       {"model", settings_.model},
       {"serial", settings_.serial},
       {"frame", settings_.frame}});
  if (!bound) return unexpected{std::move(bound.error())};
  registration_ = std::move(*bound);
  return {};
}

void HostedMedium::stop() noexcept {
  is_ending_.store(true, std::memory_order_release);
  ending_.post();
  if (thread_.is_running()) thread_.join();
}

// Runs pipelines, one after the other, until stop().
void HostedMedium::run() {
  Duration pause = kPauseMin;
  while (!is_ending_.load(std::memory_order_acquire)) {
    const MonotonicTime begin = rt::now();
    auto problem = run_pipeline();
    pipeline_.reset();
    if (!problem) return;
    if (rt::now() - begin > kPauseMax) pause = kPauseMin;
    while (problem) {
      server_.report(problem->text());
      log_.write(name_ + ": " + problem->text());
      if (ending_.wait_until(rt::now() + pause)) return;
      pause = std::min(2 * pause, kPauseMax);
      problem.reset();
      if (auto made = make_pipeline()) {
        pipeline_ = std::move(*made);
      } else {
        problem = std::move(made.error());
      }
    }
  }
}

// Runs the pipeline until it fails, which it returns, or until stop().
std::optional<SetupError> HostedMedium::run_pipeline() {
  parameters_->use(pipeline_.get());
  std::optional<SetupError> problem;
  if (auto source = TestSource::start(*pipeline_, node_, settings_.button)) {
    pipeline_->play();
    problem = watch();
  } else {
    problem = std::move(source.error());
  }
  parameters_->use(nullptr);
  return problem;
}

std::optional<SetupError> HostedMedium::watch() {
  std::uint64_t count = 0;
  MonotonicTime silent_since = rt::now();
  while (!is_ending_.load(std::memory_order_acquire)) {
    auto problem = pipeline_->wait_for_end(rt::now() + kLookInterval);
    const std::uint64_t now_count = pipeline_->piece_count();
    if (count == 0 && now_count > 0) server_.begin();
    if (problem) return problem;
    if (std::exchange(count, now_count) != now_count) silent_since = rt::now();
    if (rt::now() - silent_since > kSilenceMax) {
      return SetupError{"its pipeline has given nothing for 5 s", "its source gives no data",
                        "check the device and the pipeline's text; it is started again"};
    }
  }
  return std::nullopt;
}

}  // namespace rtpm::camerad
