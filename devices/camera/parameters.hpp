#pragma once

#include <optional>
#include <string>
#include <vector>

#include "pipeline.hpp"
#include "rtpm/configuration/configurable.hpp"
#include "rtpm/rt/pi_mutex.hpp"

namespace rtpm::camerad {

/// A medium's parameters: exposure, gain, brightness, bit rate and so on, where a source or an
/// encoder of its pipeline has a number of that name. They are named "ELEMENT.PROPERTY", and keep
/// their values when the pipeline is started again.
/// @threads  any
class Parameters final : public gvd::Configurable {
 public:
  /// @param descriptor  whose model and serial the saved values belong to
  Parameters(const Pipeline& pipeline, driver::Descriptor descriptor);

  /// Sets the parameters of `pipeline`, and those that change from now on; null: of none.
  void use(const Pipeline* pipeline);

  [[nodiscard]] const driver::Descriptor& descriptor() const noexcept override {
    return descriptor_;
  }
  [[nodiscard]] std::vector<driver::ParameterSpec> parameters() const override;
  [[nodiscard]] expected<void, gvd::ConfigurationError> apply(
      std::span<driver::ParameterSetting> settings, bool needs_inactive) override;
  [[nodiscard]] bool is_active() const noexcept override { return true; }

 private:
  struct Entry {
    std::string element;
    std::string property;
    driver::ParameterSpec spec;
    std::optional<driver::ParameterValue> value{};  ///< As set; nullopt: the pipeline's own.
  };
  void add(GstElement& element);

  driver::Descriptor descriptor_;
  mutable rt::PiMutex mutex_;
  std::vector<Entry> entries_{};
  const Pipeline* pipeline_ = nullptr;
};

}  // namespace rtpm::camerad
