#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "configuration.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/configuration/configurable.hpp"
#include "rtpm/configuration/manager.hpp"
#include "rtpm/introspection/catalog.hpp"
#include "rtpm/names/registration.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/server.hpp"
#include "wall.hpp"

namespace rtpm::servo {

inline constexpr std::string_view kStiffnessName = "wall.stiffness_newton_per_m";
inline constexpr std::string_view kDampingName = "wall.damping_newton_s_per_m";

/// The wall's stiffness and damping as parameters, limited to values that stay passive on the
/// device.
/// @ownership holds no references
/// @threads  like gvd::Configurable
class WallParameters final : public gvd::Configurable {
 public:
  /// Replaces the wall between two cycles; false if that did not happen in time.
  using Change = std::function<bool(const Wall&)>;

  WallParameters(const Configuration& configuration, const driver::Descriptor& device,
                 const Wall& wall, Change change);

  [[nodiscard]] const driver::Descriptor& descriptor() const noexcept override { return own_; }
  [[nodiscard]] std::vector<driver::ParameterSpec> parameters() const override;
  [[nodiscard]] expected<void, gvd::ConfigurationError> apply(
      std::span<driver::ParameterSetting> settings, bool needs_inactive) override;
  [[nodiscard]] bool is_active() const noexcept override { return true; }

 private:
  Configuration configuration_;
  driver::Descriptor device_;
  driver::Descriptor own_{};  ///< This program's description, for clients that request it.
  Wall wall_;
  Change change_;
};

/// Serves the wall's parameters at NAME/config and binds that name, on time-shared threads.
/// @ownership refers to the node
/// @threads  create and destroy on one thread
class ServedWall {
 public:
  /// @errors   no registry; another server holds the name
  [[nodiscard]] static expected<std::unique_ptr<ServedWall>, SetupError> create(
      rpc::Node& node, const Configuration& configuration, const driver::Descriptor& device,
      const Wall& wall, WallParameters::Change change);
  ServedWall(const ServedWall&) = delete;
  ServedWall& operator=(const ServedWall&) = delete;
  ~ServedWall();

 private:
  explicit ServedWall(std::unique_ptr<WallParameters> parameters) noexcept;

  std::unique_ptr<WallParameters> parameters_;
  std::unique_ptr<gvd::ConfigurationManager> manager_{};
  introspection::Catalog catalog_{};
  std::unique_ptr<rpc::Server> server_{};
  std::unique_ptr<names::Registration> name_{};
};

}  // namespace rtpm::servo
