#pragma once

#include <concepts>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <type_traits>
#include <variant>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/driver/driver.hpp"

/// Serializes values between two processes of one host that run the same program.
namespace rtpm::driver_host {

template <class T, class Plain>
concept Is = std::same_as<std::remove_const_t<T>, Plain>;

// The members of each type, used for reading and writing.

void fields(auto& archive, Is<driver::Axis> auto& value) {
  archive(value.name, value.is_sensed, value.is_actuated);
}
void fields(auto& archive, Is<driver::Analog> auto& value) {
  archive(value.name, value.unit, value.low, value.high);
}
void fields(auto& archive, Is<driver::Joint> auto& value) {
  archive(value.name, value.unit, value.low, value.high, value.velocity_max, value.effort_max);
}
void fields(auto& archive, Is<driver::Output> auto& value) {
  archive(value.name, value.unit, value.low, value.high, value.safe);
}
void fields(auto& archive, Is<driver::Descriptor> auto& value) {
  archive(value.device_class, value.model, value.serial, value.frame, value.axes, value.buttons,
          value.analogs, value.joints, value.outputs, value.modes, value.limits, value.workspace,
          value.rate_hz, value.position_resolution_m);
}
void fields(auto& archive, Is<driver::ParameterSpec> auto& value) {
  archive(value.name, value.type, value.unit, value.low, value.high, value.choices,
          value.vector_size, value.default_value, value.description, value.mutability);
}
void fields(auto& archive, Is<driver::ParameterSetting> auto& value) {
  archive(value.name, value.value);
}
void fields(auto& archive, Is<driver::CalibrationInfo> auto& value) {
  archive(value.name, value.description);
}
void fields(auto& archive, Is<driver::CalibrationRunning> auto& value) {
  archive(value.progress);
}
void fields(auto& archive, Is<driver::CalibrationPrompt> auto& value) {
  archive(value.progress, value.text, value.answers);
}
void fields(auto& archive, Is<driver::CalibrationDone> auto& value) {
  archive(value.settings, value.summary);
}
void fields(auto& archive, Is<driver::CalibrationFailed> auto& value) {
  archive(value.reason);
}
void fields(auto& archive, Is<SetupError> auto& value) {
  archive(value.what, value.why, value.remedy);
}

// The number of values of an enumeration.
constexpr std::uint8_t count_of(driver::DeviceClass) noexcept {
  return driver::kDeviceClassCount;
}
constexpr std::uint8_t count_of(driver::CommandMode) noexcept {
  return driver::kCommandModeCount;
}
constexpr std::uint8_t count_of(driver::ParameterType) noexcept {
  return driver::kParameterTypeCount;
}
constexpr std::uint8_t count_of(driver::Mutability) noexcept {
  return driver::kMutabilityCount;
}

template <class T>
concept IsPlain = (std::is_arithmetic_v<T> ||
                   std::is_trivially_copyable_v<T>)&&!std::is_enum_v<T> &&
                  !std::same_as<T, bool>;

/// Appends values to bytes.
class Writer {
 public:
  template <class... T>
  void operator()(const T&... values) {
    (put(values), ...);
  }
  [[nodiscard]] const std::vector<std::byte>& bytes() const noexcept { return bytes_; }

 private:
  template <class T>
  void put(const T& value) {
    if constexpr (std::same_as<T, bool>) {
      put(static_cast<std::uint8_t>(value));
    } else if constexpr (std::is_enum_v<T>) {
      put(static_cast<std::underlying_type_t<T>>(value));
    } else if constexpr (requires { fields(*this, value); }) {
      fields(*this, value);
    } else {
      static_assert(IsPlain<T>);
      const auto from = std::as_bytes(std::span(&value, 1));
      bytes_.insert(bytes_.end(), from.begin(), from.end());
    }
  }
  void put(const std::string& text) {
    put(static_cast<std::uint32_t>(text.size()));
    const auto from = std::as_bytes(std::span(text));
    bytes_.insert(bytes_.end(), from.begin(), from.end());
  }
  template <class T>
  void put(const std::vector<T>& values) {
    put(static_cast<std::uint32_t>(values.size()));
    for (const T& value : values)
      put(value);
  }
  template <class T>
  void put(const std::optional<T>& value) {
    put(value.has_value());
    if (value) put(*value);
  }
  template <class... T>
  void put(const std::variant<T...>& value) {
    put(static_cast<std::uint8_t>(value.index()));
    std::visit([&](const auto& held) { put(held); }, value);
  }

  std::vector<std::byte> bytes_{};
};

/// Reads values from another process's bytes, which may be corrupt: after reading past their end,
/// or a number out of range, ok() stays false.
/// @ownership views its bytes
class Reader {
 public:
  explicit Reader(ConstBytes bytes) noexcept : bytes_(bytes) {}

  template <class... T>
  void operator()(T&... values) {
    (take(values), ...);
  }
  /// Whether all values were present and no bytes are left.
  [[nodiscard]] bool is_whole() const noexcept { return ok_ && bytes_.empty(); }

 private:
  template <class T>
  void take(T& value) {
    if constexpr (std::same_as<T, bool>) {
      value = take_plain<std::uint8_t>() != 0;
    } else if constexpr (std::is_enum_v<T>) {
      const auto number = take_plain<std::underlying_type_t<T>>();
      ok_ = ok_ && number < count_of(T{});
      if (ok_) value = static_cast<T>(number);
    } else if constexpr (requires { fields(*this, value); }) {
      fields(*this, value);
    } else {
      value = take_plain<T>();
    }
  }
  void take(std::string& text) {
    const std::size_t size = take_count();
    text.assign(size, '\0');
    std::memcpy(text.data(), bytes_.data(), size);
    bytes_ = bytes_.subspan(size);
  }
  template <class T>
  void take(std::vector<T>& values) {
    const std::size_t count = take_count();
    values.clear();
    for (std::size_t i = 0; i < count && ok_; ++i)
      take(values.emplace_back());
  }
  template <class T>
  void take(std::optional<T>& value) {
    value.reset();
    if (take_plain<std::uint8_t>() != 0) take(value.emplace());
  }
  template <class... T>
  void take(std::variant<T...>& value) {
    const std::size_t index = take_plain<std::uint8_t>();
    ok_ = ok_ && index < sizeof...(T);
    std::size_t i = 0;
    ((i++ == index && ok_ ? take(value.template emplace<T>()) : void()), ...);
  }

  template <class T>
  [[nodiscard]] T take_plain() {
    static_assert(IsPlain<T>);
    T value{};
    ok_ = ok_ && bytes_.size() >= sizeof value;
    if (!ok_) return T{};
    std::memcpy(static_cast<void*>(&value), bytes_.data(), sizeof value);
    bytes_ = bytes_.subspan(sizeof value);
    return value;
  }
  /// Reads the count of elements that each take at least one byte.
  [[nodiscard]] std::size_t take_count() {
    const auto count = take_plain<std::uint32_t>();
    ok_ = ok_ && count <= bytes_.size();
    return ok_ ? count : 0;
  }

  ConstBytes bytes_;
  bool ok_ = true;
};

}  // namespace rtpm::driver_host
