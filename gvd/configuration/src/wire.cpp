#include "wire.hpp"

#include <type_traits>
#include <utility>
#include <variant>

namespace rtpm::gvd {

using driver::ParameterSetting;
using driver::ParameterSpec;
using driver::ParameterType;
using driver::ParameterValue;

std::unique_ptr<configuration::ValueT> to_wire(const ParameterValue& value) {
  auto wire = std::make_unique<configuration::ValueT>();
  std::visit(
      [&](const auto& held) {
        using Held = std::decay_t<decltype(held)>;
        if constexpr (std::is_same_v<Held, bool>) {
          wire->type = configuration::ParameterType::Bool;
          wire->flag = held;
        } else if constexpr (std::is_same_v<Held, std::int64_t>) {
          wire->type = configuration::ParameterType::Integer;
          wire->integer = held;
        } else if constexpr (std::is_same_v<Held, double>) {
          wire->type = configuration::ParameterType::Real;
          wire->real = held;
        } else if constexpr (std::is_same_v<Held, std::string>) {
          wire->type = configuration::ParameterType::Text;
          wire->text = held;
        } else {
          wire->type = configuration::ParameterType::Vector;
          wire->elements = held;
        }
      },
      value);
  return wire;
}

ParameterValue from_wire(const configuration::ValueT& wire) {
  switch (wire.type) {
    case configuration::ParameterType::Bool:
      return wire.flag;
    case configuration::ParameterType::Integer:
      return std::int64_t{wire.integer};
    case configuration::ParameterType::Real:
      return wire.real;
    case configuration::ParameterType::Text:
    case configuration::ParameterType::Choice:
      return wire.text;
    case configuration::ParameterType::Vector:
      return wire.elements;
  }
  return std::vector<double>{};
}

WireSettings to_wire(const std::vector<ParameterSetting>& settings) {
  WireSettings wire;
  for (const ParameterSetting& setting : settings) {
    auto one = std::make_unique<configuration::SettingT>();
    one->name = setting.name;
    one->value = to_wire(setting.value);
    wire.push_back(std::move(one));
  }
  return wire;
}

std::vector<ParameterSetting> from_wire(const WireSettings& wire) {
  std::vector<ParameterSetting> settings;
  for (const auto& one : wire) {
    settings.push_back({one->name, from_wire(*one->value)});
  }
  return settings;
}

std::unique_ptr<configuration::ParameterT> to_wire(const ParameterSpec& spec,
                                                   const ParameterValue& value) {
  auto wire = std::make_unique<configuration::ParameterT>();
  wire->name = spec.name;
  wire->type = static_cast<configuration::ParameterType>(spec.type);
  wire->unit = spec.unit;
  wire->low = spec.low;
  wire->high = spec.high;
  wire->choices = spec.choices;
  wire->vector_size = static_cast<std::uint32_t>(spec.vector_size);
  wire->default_value = to_wire(spec.default_value);
  wire->value = to_wire(value);
  wire->description = spec.description;
  wire->mutability = static_cast<configuration::Mutability>(spec.mutability);
  return wire;
}

ParameterSpec spec_from_wire(const configuration::ParameterT& wire) {
  const auto type = static_cast<std::uint8_t>(wire.type);
  const auto mutability = static_cast<std::uint8_t>(wire.mutability);
  return {.name = wire.name,
          .type = type < driver::kParameterTypeCount ? static_cast<ParameterType>(type)
                                                     : ParameterType::kText,
          .unit = wire.unit,
          .low = wire.low,
          .high = wire.high,
          .choices = wire.choices,
          .vector_size = wire.vector_size,
          .default_value = from_wire(*wire.default_value),
          .description = wire.description,
          .mutability = mutability < driver::kMutabilityCount
                            ? static_cast<driver::Mutability>(mutability)
                            : driver::Mutability::kReadOnly};
}

std::unique_ptr<configuration::AnswerT> to_wire(const ConfigurationError* error) {
  auto wire = std::make_unique<configuration::AnswerT>();
  if (error == nullptr) return wire;
  wire->outcome = static_cast<configuration::OutcomeCode>(error->outcome);
  wire->parameter = error->parameter;
  wire->what = error->words.what;
  wire->why = error->words.why;
  wire->remedy = error->words.remedy;
  return wire;
}

ConfigurationError from_wire(const configuration::AnswerT& wire) {
  const auto outcome = static_cast<std::uint8_t>(wire.outcome);
  return {outcome < kConfigurationOutcomeCount ? static_cast<ConfigurationOutcome>(outcome)
                                               : ConfigurationOutcome::kCallFailed,
          wire.parameter,
          {wire.what, wire.why, wire.remedy}};
}

configuration::CalibrationReplyT to_wire(const CalibrationStatus& status) {
  configuration::CalibrationReplyT wire;
  wire.answer = to_wire(nullptr);
  wire.run = status.run;
  wire.name = status.name;
  wire.phase = static_cast<configuration::CalibrationPhase>(status.phase);
  wire.progress = status.progress;
  wire.prompt = status.prompt;
  wire.text = status.text;
  wire.answers = status.answers;
  wire.settings = to_wire(status.settings);
  return wire;
}

CalibrationStatus from_wire(const configuration::CalibrationReplyT& wire) {
  const auto phase = static_cast<std::uint8_t>(wire.phase);
  return {.run = wire.run,
          .name = wire.name,
          .phase = phase < kCalibrationPhaseCount ? static_cast<CalibrationPhase>(phase)
                                                  : CalibrationPhase::kFailed,
          .progress = wire.progress,
          .prompt = wire.prompt,
          .text = wire.text,
          .answers = wire.answers,
          .settings = from_wire(wire.settings)};
}

}  // namespace rtpm::gvd
