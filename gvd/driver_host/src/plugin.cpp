#include "rtpm/driver_host/plugin.hpp"

#include <dlfcn.h>

#include <exception>
#include <utility>

#include "rtpm/driver/plugin.hpp"

namespace rtpm::driver_host {
namespace {

using driver::Driver;
using driver::Plugin;

/// A loaded shared library.
class Library {
 public:
  explicit Library(void* handle) noexcept : handle_(handle) {}
  Library(Library&& other) noexcept : handle_(std::exchange(other.handle_, nullptr)) {}
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;
  Library& operator=(Library&&) = delete;
  ~Library() {
    if (handle_ != nullptr) dlclose(handle_);
  }
  [[nodiscard]] const Plugin* plugin() const noexcept {
    return static_cast<const Plugin*>(dlsym(handle_, driver::kPluginSymbol));
  }

 private:
  void* handle_;
};

SetupError failure(const std::string& file, const char* where, std::string why) {
  return {.what = "the driver of plug-in " + file + " failed in " + where,
          .why = std::move(why),
          .remedy = "ask its author; a driver returns errors"};
}

/// Calls into a plug-in; an exception becomes an error.
template <class Function>
auto guarded(const std::string& file, const char* where, Function&& call) -> decltype(call()) {
  try {
    return call();
  } catch (const std::exception& exception) {
    return unexpected{failure(file, where, exception.what())};
  } catch (...) {
    return unexpected{failure(file, where, "it threw something that is no std::exception")};
  }
}

/// Passes calls on to a plug-in's driver, and turns what it throws into errors.
class PluginDriver final : public Driver {
 public:
  PluginDriver(std::string file, Library library, std::unique_ptr<Driver> driver,
               driver::Descriptor descriptor) noexcept
      : file_(std::move(file)),
        library_(std::move(library)),
        driver_(std::move(driver)),
        descriptor_(std::move(descriptor)) {}

  [[nodiscard]] driver::Descriptor describe() const override { return descriptor_; }
  [[nodiscard]] expected<void, SetupError> configure(const driver::DriverConfig& config) override {
    return guarded(file_, "configure()", [&] { return driver_->configure(config); });
  }
  [[nodiscard]] expected<void, SetupError> activate() override {
    return guarded(file_, "activate()", [&] { return driver_->activate(); });
  }
  [[nodiscard]] driver::ExchangeStatus exchange(const driver::Command& command,
                                                driver::Sample& sample) noexcept override {
    return driver_->exchange(command, sample);
  }
  void deactivate() noexcept override { driver_->deactivate(); }
  [[nodiscard]] std::vector<driver::ParameterSpec> parameters() const override {
    return driver_->parameters();
  }
  [[nodiscard]] expected<void, SetupError> set_parameters(
      std::span<driver::ParameterSetting> settings) override {
    return guarded(file_, "set_parameters()", [&] { return driver_->set_parameters(settings); });
  }
  [[nodiscard]] std::vector<driver::CalibrationInfo> calibrations() const override {
    return driver_->calibrations();
  }
  [[nodiscard]] std::unique_ptr<driver::Calibration> make_calibration(
      std::string_view name) override {
    return driver_->make_calibration(name);
  }

 private:
  std::string file_;
  Library library_;  // Outlives its driver.
  std::unique_ptr<Driver> driver_;
  driver::Descriptor descriptor_;
};

expected<void, SetupError> check(const std::string& file, const Plugin* plugin) {
  if (plugin == nullptr || plugin->magic != driver::kPluginMagic || plugin->create == nullptr) {
    return setup_error(file + " is no plug-in of RTPM",
                       "it does not export " + std::string(driver::kPluginSymbol),
                       "add RTPM_DRIVER_PLUGIN to one of its sources");
  }
  const Plugin own{};
  if (plugin->abi == own.abi && plugin->sample_size == own.sample_size &&
      plugin->command_size == own.command_size && plugin->descriptor_size == own.descriptor_size &&
      plugin->compiler_abi == own.compiler_abi) {
    return {};
  }
  return setup_error("the plug-in " + file + " was built for another RTPM or by another compiler",
                     "its interface is " + std::to_string(plugin->abi) + ", this program's is " +
                         std::to_string(own.abi),
                     "build it against the RTPM that is installed here");
}

}  // namespace

expected<std::unique_ptr<Driver>, SetupError> load_plugin(const std::string& file,
                                                          std::string_view arguments) {
  // A bare name would be searched for among the system's libraries.
  const std::string path = file.find('/') == std::string::npos ? "./" + file : file;
  void* const handle = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (handle == nullptr) {
    return setup_error("the plug-in " + file + " can't be loaded", dlerror(),
                       "name the file of a shared library that is built for this machine");
  }
  Library library(handle);
  const Plugin* const plugin = library.plugin();
  if (auto checked = check(file, plugin); !checked) return unexpected{checked.error()};
  return guarded(file, "its set-up", [&]() -> expected<std::unique_ptr<Driver>, SetupError> {
    auto driver = plugin->create(arguments);
    if (!driver) return unexpected{driver.error()};
    if (*driver == nullptr) {
      return setup_error("the plug-in " + file + " made no driver", "", "ask its author");
    }
    driver::Descriptor descriptor = (*driver)->describe();
    return std::make_unique<PluginDriver>(file, std::move(library), std::move(*driver),
                                          std::move(descriptor));
  });
}

}  // namespace rtpm::driver_host
