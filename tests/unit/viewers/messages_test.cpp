#include "rtpm/viewers/messages.hpp"

#include <cmath>
#include <vector>

#include "decoded.hpp"

namespace rtpm::viewers {
namespace {

using driver::Vector3;
using nlohmann::json;

constexpr std::uint64_t kTimeNs = 1'700'000'000'123'456'789;
const json kTime{{"sec", 1'700'000'000}, {"nsec", 123'456'789}};
constexpr Stamp kStamp{kTimeNs, "lab/arm0/base"};
constexpr driver::Pose kPose{{0.1, -0.2, 0.3}, {0, 0, 0.6, 0.8}};
const std::vector kBytes{std::byte{1}, std::byte{0}, std::byte{255}};

Vector3 vector_of(const json& value) {
  return {value.value("x", 0.0), value.value("y", 0.0), value.value("z", 0.0)};
}

/// The direction to which a rotation turns +x.
Vector3 direction_of(const json& turn) {
  const Vector3 axis = vector_of(turn);
  const double w = turn.value("w", 1.0);
  return {1 - 2 * (axis.y * axis.y + axis.z * axis.z), 2 * (axis.x * axis.y + w * axis.z),
          2 * (axis.x * axis.z - w * axis.y)};
}

void expect_near(const Vector3& a, const Vector3& b) {
  EXPECT_NEAR(a.x, b.x, 1e-9);
  EXPECT_NEAR(a.y, b.y, 1e-9);
  EXPECT_NEAR(a.z, b.z, 1e-9);
}

json scene_of(const Scene& scene) {
  return decoded(Type::kSceneUpdate, scene_message(kStamp, scene));
}

json models_of(std::vector<gvd::Model> models) {
  return scene_of({.device = "lab/arm0",
                   .models = models,
                   .low_m = {-1, -1, -1},
                   .high_m = {1, 1, 1}})["entities"][1];
}

TEST(ViewerMessages, ThatAPoseIsInItsFrame) {
  const json pose = decoded(Type::kPoseInFrame, pose_message(kStamp, kPose));
  EXPECT_EQ(pose["timestamp"], kTime);
  EXPECT_EQ(pose["frame_id"], "lab/arm0/base");
  EXPECT_EQ(vector_of(pose["pose"]["position"]), kPose.position_m);
  EXPECT_EQ(pose["pose"]["orientation"]["z"], 0.6);
  EXPECT_EQ(pose["pose"]["orientation"]["w"], 0.8);
}

TEST(ViewerMessages, ThatATransformLeadsFromTheFrameToTheDevice) {
  const json all = decoded(Type::kFrameTransforms, transform_message(kStamp, "lab/arm0", kPose));
  ASSERT_EQ(all["transforms"].size(), 1u);
  const json& one = all["transforms"][0];
  EXPECT_EQ(one["timestamp"], kTime);
  EXPECT_EQ(one["parent_frame_id"], "lab/arm0/base");
  EXPECT_EQ(one["child_frame_id"], "lab/arm0");
  EXPECT_EQ(vector_of(one["translation"]), kPose.position_m);
  EXPECT_EQ(one["rotation"]["w"], 0.8);
}

TEST(ViewerMessages, ThatTheArrowIsTheForce) {
  for (const Vector3 force : {Vector3{3, 0, 0}, Vector3{-2, 0, 0}, Vector3{0, 1, -4}}) {
    const double newton = std::hypot(force.x, force.y, force.z);
    const json scene = scene_of({.device = "lab/arm0",
                                 .position_m = kPose.position_m,
                                 .force_newton = force,
                                 .lifetime_ns = 250'000'000});
    const json& entity = scene["entities"][0];
    EXPECT_EQ(entity["id"], "lab/arm0/force");
    EXPECT_EQ(entity["frame_id"], "lab/arm0/base");
    EXPECT_EQ(entity["lifetime"]["nsec"], 250'000'000);
    ASSERT_EQ(entity["arrows"].size(), 1u);
    const json& arrow = entity["arrows"][0];
    EXPECT_NEAR(arrow["shaft_length"].get<double>() + arrow["head_length"].get<double>(),
                newton * kArrowMetrePerNewton, 1e-9);
    EXPECT_EQ(vector_of(arrow["pose"]["position"]), kPose.position_m);
    expect_near(direction_of(arrow["pose"]["orientation"]),
                {force.x / newton, force.y / newton, force.z / newton});
  }
}

TEST(ViewerMessages, ThatNoForceIsNoArrow) {
  EXPECT_TRUE(scene_of({.device = "lab/arm0"})["entities"][0]["arrows"].empty());
}

TEST(ViewerMessages, ThatModelsAreShapes) {
  const json plane = models_of({gvd::Plane{.point_m = {5, 0, 0.25}, .normal = {0, 0, 1}}});
  ASSERT_EQ(plane["cubes"].size(), 1u);
  const json& plate = plane["cubes"][0];
  expect_near(direction_of(plate["pose"]["orientation"]), {0, 0, 1});
  // The face, half of the plate's thickness above its middle, is the plane.
  EXPECT_NEAR(plate["pose"]["position"]["z"].get<double>() + plate["size"]["x"].get<double>() / 2,
              0.25, 1e-9);
  EXPECT_EQ(plate["pose"]["position"]["x"], 0.0);

  const json ball = models_of({gvd::Sphere{.centre_m = {0.1, 0.2, 0.3}, .radius_m = 0.05}});
  EXPECT_EQ(vector_of(ball["spheres"][0]["pose"]["position"]), (Vector3{0.1, 0.2, 0.3}));
  EXPECT_EQ(vector_of(ball["spheres"][0]["size"]), (Vector3{0.1, 0.1, 0.1}));

  const json box = models_of({gvd::Box{.low_m = {0, 0, 0}, .high_m = {0.5, 1, 2}}});
  EXPECT_EQ(vector_of(box["cubes"][0]["pose"]["position"]), (Vector3{0.25, 0.5, 1}));
  EXPECT_EQ(vector_of(box["cubes"][0]["size"]), (Vector3{0.5, 1, 2}));

  const json spring = models_of({gvd::Spring{.anchor_m = {0.1, 0, 0}}});
  EXPECT_EQ(vector_of(spring["lines"][0]["points"][0]), (Vector3{0.1, 0, 0}));

  const json field = models_of({gvd::AffineField{
      .origin_m = {0, 0, 0.1}, .force_newton = {2, 0, 0}, .radius_m = 0.1, .fade_m = 0.1}});
  EXPECT_NEAR(field["spheres"][0]["size"]["x"].get<double>(), 0.4, 1e-9);
  EXPECT_EQ(field["arrows"].size(), 1u);

  EXPECT_EQ(models_of({gvd::Detents{.spacing_m = 0.01}})["spheres"].size(), 11u);
  const json nothing = models_of({gvd::Friction{.force_newton = 1}, gvd::DialDetents{}});
  EXPECT_TRUE(nothing["spheres"].empty() && nothing["cubes"].empty() && nothing["lines"].empty());
}

TEST(ViewerMessages, ThatPicturesAndSoundKeepTheirBytes) {
  const json bytes{1, 0, 255};
  const json video = decoded(Type::kCompressedVideo, video_message(kStamp, "h264", kBytes));
  EXPECT_EQ(video["timestamp"], kTime);
  EXPECT_EQ(video["format"], "h264");
  EXPECT_EQ(video["data"], bytes);
  const json image = decoded(Type::kCompressedImage, image_message(kStamp, "jpeg", kBytes));
  EXPECT_EQ(image["format"], "jpeg");
  EXPECT_EQ(image["data"], bytes);
  const json sound = decoded(Type::kRawAudio, audio_message(kTimeNs, kBytes, 48'000, 2));
  EXPECT_EQ(sound["timestamp"], kTime);
  EXPECT_EQ(sound["format"], "pcm-s16");
  EXPECT_EQ(sound["sample_rate"], 48'000);
  EXPECT_EQ(sound["number_of_channels"], 2);
  EXPECT_EQ(sound["data"], bytes);
}

}  // namespace
}  // namespace rtpm::viewers
