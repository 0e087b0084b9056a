#include "rtpm/gvd/models_wire.hpp"

#include <array>
#include <device_events.rtpm.events.hpp>
#include <optional>
#include <utility>

#include "rtpm/gvd/wire.hpp"

namespace rtpm::gvd {
namespace {

device::Plane wire_of(const Plane& plane) {
  return {to_wire(plane.point_m), to_wire(plane.normal), plane.stiffness_newton_per_m,
          plane.damping_newton_s_per_m};
}
device::Sphere wire_of(const Sphere& sphere) {
  return {to_wire(sphere.centre_m), sphere.radius_m, sphere.stiffness_newton_per_m,
          sphere.damping_newton_s_per_m, static_cast<device::Side>(sphere.side)};
}
device::Box wire_of(const Box& box) {
  return {to_wire(box.low_m), to_wire(box.high_m), box.stiffness_newton_per_m,
          box.damping_newton_s_per_m, static_cast<device::Side>(box.side)};
}
device::Spring wire_of(const Spring& spring) {
  return {to_wire(spring.anchor_m), spring.stiffness_newton_per_m, spring.damping_newton_s_per_m,
          spring.force_newton_max};
}
device::AffineField wire_of(const AffineField& field) {
  return {to_wire(field.origin_m), to_wire(field.force_newton), field.jacobian_newton_per_m,
          field.radius_m, field.fade_m};
}
device::Friction wire_of(const Friction& friction) {
  return {friction.force_newton, friction.stiffness_newton_per_m,
          friction.viscosity_newton_s_per_m};
}
device::Detents wire_of(const Detents& detents) {
  return {to_wire(detents.origin_m), to_wire(detents.direction), detents.spacing_m,
          detents.force_newton, detents.damping_newton_s_per_m};
}
device::DialDetents wire_of(const DialDetents& detents) {
  return {detents.origin_rad,
          detents.spacing_rad,
          detents.effort_newton_metre,
          detents.damping_newton_metre_s_per_rad,
          detents.low_rad,
          detents.high_rad,
          detents.end_stiffness_newton_metre_per_rad,
          detents.joint};
}

Plane model_of(const device::Plane& wire) {
  return {from_wire(wire.point_m()), from_wire(wire.normal()), wire.stiffness_newton_per_m(),
          wire.damping_newton_s_per_m()};
}
Sphere model_of(const device::Sphere& wire) {
  return {from_wire(wire.centre_m()), wire.radius_m(), static_cast<Side>(wire.side()),
          wire.stiffness_newton_per_m(), wire.damping_newton_s_per_m()};
}
Box model_of(const device::Box& wire) {
  return {from_wire(wire.low_m()), from_wire(wire.high_m()), static_cast<Side>(wire.side()),
          wire.stiffness_newton_per_m(), wire.damping_newton_s_per_m()};
}
Spring model_of(const device::Spring& wire) {
  return {from_wire(wire.anchor_m()), wire.stiffness_newton_per_m(), wire.damping_newton_s_per_m(),
          wire.force_newton_max()};
}
AffineField model_of(const device::AffineField& wire) {
  AffineField field{from_wire(wire.origin_m()),
                    from_wire(wire.force_newton()),
                    {},
                    wire.radius_m(),
                    wire.fade_m()};
  std::uint16_t at = 0;
  for (double& element : field.jacobian_newton_per_m)
    element = wire.jacobian_newton_per_m()->Get(at++);
  return field;
}
Friction model_of(const device::Friction& wire) {
  return {wire.force_newton(), wire.stiffness_newton_per_m(), wire.viscosity_newton_s_per_m()};
}
Detents model_of(const device::Detents& wire) {
  return {from_wire(wire.origin_m()), from_wire(wire.direction()), wire.spacing_m(),
          wire.force_newton(), wire.damping_newton_s_per_m()};
}
DialDetents model_of(const device::DialDetents& wire) {
  return {wire.joint(),
          wire.origin_rad(),
          wire.spacing_rad(),
          wire.effort_newton_metre(),
          wire.damping_newton_metre_s_per_rad(),
          wire.low_rad(),
          wire.high_rad(),
          wire.end_stiffness_newton_metre_per_rad()};
}

/// The model, if exactly one of its fields is present.
std::optional<Model> model_of(const device::Model& wire) {
  std::optional<Model> model;
  int count = 0;
  const auto take = [&](const auto* present) {
    if (present == nullptr) return;
    model = model_of(*present);
    ++count;
  };
  take(wire.plane());
  take(wire.sphere());
  take(wire.box());
  take(wire.spring());
  take(wire.affine_field());
  take(wire.friction());
  take(wire.detents());
  take(wire.dial_detents());
  return count == 1 ? model : std::nullopt;
}

/// Puts a model into its field of the table.
struct Packer {
  device::ModelT& wire;

  void operator()(const Plane& model) const { put(wire.plane, model); }
  void operator()(const Sphere& model) const { put(wire.sphere, model); }
  void operator()(const Box& model) const { put(wire.box, model); }
  void operator()(const Spring& model) const { put(wire.spring, model); }
  void operator()(const AffineField& model) const { put(wire.affine_field, model); }
  void operator()(const Friction& model) const { put(wire.friction, model); }
  void operator()(const Detents& model) const { put(wire.detents, model); }
  void operator()(const DialDetents& model) const { put(wire.dial_detents, model); }

 private:
  template <class Wire, class Of>
  static void put(std::unique_ptr<Wire>& field, const Of& model) {
    field = std::make_unique<Wire>(wire_of(model));
  }
};

using WireModels = flatbuffers::Vector<flatbuffers::Offset<device::Model>>;

expected<ModelList, std::string> list_of(const WireModels& wire) {
  std::array<Model, ModelList::kCountMax> models{};
  const std::size_t count = wire.size();
  if (count > models.size()) {
    return unexpected{std::to_string(count) + " models; send at most " +
                      std::to_string(models.size())};
  }
  std::size_t index = 0;
  for (const device::Model* packed : wire) {
    const auto model = model_of(*packed);
    if (!model) {
      return unexpected{"model " + std::to_string(index) +
                        ": kind is not exactly one that this device's server knows"};
    }
    models[index++] = *model;
  }
  return ModelList{{models.data(), count}};
}

}  // namespace

std::vector<std::unique_ptr<device::ModelT>> to_wire(std::span<const Model> models) {
  std::vector<std::unique_ptr<device::ModelT>> wire;
  wire.reserve(models.size());
  for (const Model& model : models) {
    auto packed = std::make_unique<device::ModelT>();
    std::visit(Packer{*packed}, model);
    wire.push_back(std::move(packed));
  }
  return wire;
}

expected<ModelList, std::string> from_wire(const device::SetModelsRequest& wire) {
  return list_of(*wire.models());
}

std::optional<ModelList> models_of(std::uint64_t schema_id, ConstBytes payload) {
  using Event = device::ModelsRenderedEvent;
  if (schema_id != Event::kSchemaId ||
      !rpc::is_valid_table<Event::Payload>(payload, Event::kLimits)) {
    return std::nullopt;
  }
  const auto list = list_of(*flatbuffers::GetRoot<Event::Payload>(payload.data())->models());
  return list ? std::optional(*list) : std::nullopt;
}

}  // namespace rtpm::gvd
