#include "drawing.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "braille.hpp"
#include "picture.hpp"

namespace rtpm::scene {
namespace {

constexpr const char* kBlank = "\u2800";

TouchReport touching(Shape shape, double x_m = 0) {
  return {.scene = {shape, 0},
          .touch = {.device_m = {x_m, 0.002, -0.004},
                    .proxy_m = {x_m, 0.002, 0},
                    .force_newton = {0, 0, 2},
                    .depth_m = 0.004}};
}

std::vector<Line> lines_of(const Panel& panel, Ink ink) {
  std::vector<Line> lines;
  std::ranges::copy_if(panel.lines, std::back_inserter(lines),
                       [ink](const Line& line) { return line.ink == ink; });
  return lines;
}

TEST(SectionPanel, ShowsPathsSpringAndForce) {
  const std::vector<driver::Vector3> device_m{{0, 0, 0.01}, {0, 0.002, -0.004}};
  const std::vector<TouchReport> touches{touching(Shape::kPlane)};
  const Panel panel = section_panel({device_m, touches, 1});
  EXPECT_EQ(panel.right_axis + panel.up_axis, "xz");
  const auto forces = lines_of(panel, Ink::kForce);
  ASSERT_EQ(forces.size(), 1u);
  EXPECT_DOUBLE_EQ(forces[0].points[0].up_mm, 0) << "from the proxy";
  EXPECT_DOUBLE_EQ(forces[0].points[1].up_mm, 2 * kMmPerNewton);
  const auto springs = lines_of(panel, Ink::kSpring);
  ASSERT_EQ(springs.size(), 1u);
  EXPECT_DOUBLE_EQ(springs[0].points[0].up_mm, -4) << "from the device";
  ASSERT_EQ(lines_of(panel, Ink::kDevice).size(), 1u);
  EXPECT_DOUBLE_EQ(lines_of(panel, Ink::kDevice)[0].points[0].up_mm, 10);
  EXPECT_DOUBLE_EQ(lines_of(front_panel({device_m, touches, 1}), Ink::kDevice)[0].points[1].up_mm,
                   2)
      << "the front shows y";
}

TEST(SectionPanel, ShowsEveryNthForceFromTheNewest) {
  std::vector<TouchReport> touches;
  for (int i = 0; i < 10; ++i)
    touches.push_back(touching(Shape::kSphere, 0.001 * i));
  const auto forces = lines_of(section_panel({{}, touches, 4}), Ink::kForce);
  ASSERT_EQ(forces.size(), 3u);
  EXPECT_DOUBLE_EQ(forces.back().points[0].right_mm, 9);
  EXPECT_TRUE(lines_of(section_panel({{}, touches, 0}), Ink::kForce).empty());
}

TEST(Panels, HaveNoSolidBeforeTheFirstTouch) {
  EXPECT_TRUE(section_panel({}).solid.empty());
  EXPECT_TRUE(front_panel({}).solid.empty());
  for (const Shape shape : {Shape::kPlane, Shape::kSphere, Shape::kTexture}) {
    const std::vector<TouchReport> touches{touching(shape)};
    EXPECT_FALSE(section_panel({{}, touches, 1}).solid.empty()) << to_string(shape);
    EXPECT_FALSE(front_panel({{}, touches, 1}).solid.empty()) << to_string(shape);
  }
}

TEST(BrailleRows, DrawADotWhereALineIs) {
  Panel panel{.low = {0, 0}};
  // Two by one characters have four by four dots.
  panel.lines = {{Ink::kProxy, {{1, 59}}}};
  EXPECT_EQ(braille_rows(panel, 2, 1, false), std::vector<std::string>{"\u2801"
                                                                       "\u2800"})
      << "top left";
  panel.lines = {{Ink::kProxy, {{89, 1}}}};
  EXPECT_EQ(braille_rows(panel, 2, 1, false), std::vector<std::string>{"\u2800"
                                                                       "\u2880"})
      << "bottom right";
  panel.lines = {{Ink::kProxy, {{0.5, 59.5}, {0.5, 0.5}}}};
  EXPECT_EQ(braille_rows(panel, 1, 2, false), (std::vector<std::string>{"\u2847", "\u2847"}));
}

TEST(BrailleRows, KeepTheirWidthForAnyDrawing) {
  Panel panel{.low = {-45, -30}};
  panel.solid = {{-1e9, -1e9}, {1e9, -1e9}, {0, 1e9}};
  panel.lines = {{Ink::kForce, {{-1e12, 3}, {1e12, 5}}}, {Ink::kDevice, {}}};
  for (const std::string& row : braille_rows(panel, 38, 13, false))
    EXPECT_EQ(row.size(), 38 * std::string(kBlank).size());
  EXPECT_EQ(braille_rows(panel, 38, 13, false).size(), 13u);
}

TEST(BrailleRows, HaveTheUppermostLinesColourAndResetIt) {
  Panel panel{.low = {0, 0}};
  panel.lines = {{Ink::kDevice, {{45, 30}}}, {Ink::kForce, {{45, 30}}}};
  const auto rows = braille_rows(panel, 1, 1, true);
  EXPECT_EQ(rows[0].find("\033[91m"), 0u) << "the force's, not the device's";
  EXPECT_TRUE(rows[0].ends_with("\033[0m"));
}

TEST(SvgText, HasAnAxisALegendAndTheCaption) {
  const std::vector<TouchReport> touches{touching(Shape::kTexture), touching(Shape::kTexture)};
  const std::vector<driver::Vector3> device_m{{0, 0, 0.01}, {0, 0.002, -0.004}};
  const Story story{device_m, touches, 1};
  const std::vector<Panel> panels{section_panel(story), front_panel(story)};
  const std::string svg = svg_text(panels, "a <device> & \"more\"");
  EXPECT_TRUE(svg.starts_with("<svg xmlns="));
  EXPECT_TRUE(svg.ends_with("</svg>\n"));
  for (const char* part :
       {">section<", ">front<", ">x / mm<", ">-20<", ">proxy<", ">force, 3 mm per newton<",
        "a &lt;device&gt; &amp; &quot;more&quot;", "marker-end"}) {
    EXPECT_NE(svg.find(part), std::string::npos) << part;
  }
  for (const char* part : {"nan", "inf", "<device>"})
    EXPECT_EQ(svg.find(part), std::string::npos) << part;
}

TEST(WriteFile, SaysWhereItFails) {
  const auto written = write_file("/nowhere/picture.svg", "");
  ASSERT_FALSE(written);
  EXPECT_NE(written.error().text().find("/nowhere/picture.svg"), std::string::npos);
}

}  // namespace
}  // namespace rtpm::scene
