#pragma once

#include <memory>
#include <new>
#include <type_traits>
#include <utility>

#include "rtpm/base/assert.hpp"

namespace rtpm::inline base {

/// Wraps an error so that it converts to any expected<T, E> with the same E.
template <class E>
struct unexpected {
  E error;
};
template <class E>
unexpected(E) -> unexpected<E>;

/// A value or an error: the part of C++23's std::expected that RTPM uses, for C++20. Reading the
/// wrong side is a bug and aborts; nothing throws.
/// @ownership holds its value or error in place
/// @threads  like any plain value
/// @realtime alloc-free if T and E are
template <class T, class E>
class [[nodiscard]] expected {
 public:
  using value_type = T;
  using error_type = E;

  expected() noexcept(
      std::is_nothrow_default_constructible_v<T>) requires std::is_default_constructible_v<T>
      : has_value_(true) {
    std::construct_at(&value_);
  }
  template <class U = T>
  requires(std::is_constructible_v<T, U&&> && !std::is_same_v<std::remove_cvref_t<U>, expected>)
      // NOLINTNEXTLINE(google-explicit-constructor, bugprone-forwarding-reference-overload)
      expected(U&& value)
      : has_value_(true) {
    std::construct_at(&value_, std::forward<U>(value));
  }
  /// Constructs the value in place.
  template <class... Arguments>
  explicit expected(std::in_place_t, Arguments&&... arguments) : has_value_(true) {
    // Not with construct_at, which can't call a constructor that is private to friends.
    ::new (static_cast<void*>(&value_)) T(std::forward<Arguments>(arguments)...);
  }
  template <class G>
  requires std::is_constructible_v<E, G&&>
  // NOLINTNEXTLINE(google-explicit-constructor): a function that fails returns its error as is.
  expected(unexpected<G> failure) : has_value_(false) {
    std::construct_at(&error_, std::move(failure.error));
  }
  expected(const expected& other) requires(
      std::is_copy_constructible_v<T>&& std::is_copy_constructible_v<E>)
      : has_value_(other.has_value_) {
    if (has_value_) {
      std::construct_at(&value_, other.value_);
    } else {
      std::construct_at(&error_, other.error_);
    }
  }
  expected(expected&& other) noexcept(std::is_nothrow_move_constructible_v<T>)
      : has_value_(other.has_value_) {
    if (has_value_) {
      std::construct_at(&value_, std::move(other.value_));
    } else {
      std::construct_at(&error_, std::move(other.error_));
    }
  }
  expected& operator=(expected other) noexcept(std::is_nothrow_move_constructible_v<T>) {
    std::destroy_at(this);
    return *std::construct_at(this, std::move(other));
  }
  ~expected() {
    if (has_value_) {
      std::destroy_at(&value_);
    } else {
      std::destroy_at(&error_);
    }
  }

  [[nodiscard]] bool has_value() const noexcept { return has_value_; }
  explicit operator bool() const noexcept { return has_value_; }

  [[nodiscard]] T& value() & noexcept { return check(), value_; }
  [[nodiscard]] const T& value() const& noexcept { return check(), value_; }
  [[nodiscard]] T&& value() && noexcept { return check(), std::move(value_); }
  [[nodiscard]] T& operator*() & noexcept { return value(); }
  [[nodiscard]] const T& operator*() const& noexcept { return value(); }
  [[nodiscard]] T&& operator*() && noexcept { return std::move(*this).value(); }
  [[nodiscard]] T* operator->() noexcept { return check(), &value_; }
  [[nodiscard]] const T* operator->() const noexcept { return check(), &value_; }
  [[nodiscard]] E& error() noexcept { return check_error(), error_; }
  [[nodiscard]] const E& error() const noexcept { return check_error(), error_; }
  template <class U>
  [[nodiscard]] T value_or(U&& fallback) const& {
    return has_value_ ? value_ : static_cast<T>(std::forward<U>(fallback));
  }

 private:
  void check() const noexcept { RTPM_ASSERT(has_value_, "the value of a failed result was read"); }
  void check_error() const noexcept {
    RTPM_ASSERT(!has_value_, "the error of a successful result was read");
  }

  bool has_value_;
  union {
    T value_;
    E error_;
  };
};

/// The value type of an operation that returns no value.
struct Nothing {};

/// The result of an operation that returns no value but can fail.
template <class E>
class [[nodiscard]] expected<void, E> : public expected<Nothing, E> {
 public:
  using value_type = void;
  using expected<Nothing, E>::expected;
  void value() const noexcept { static_cast<void>(expected<Nothing, E>::value()); }
};

}  // namespace rtpm::inline base
