#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <room.rtpm.hpp>
#include <string>

#include "rtpm/introspection/catalog.hpp"
#include "rtpm/rpc/server.hpp"

namespace rtpm::introspection::test {

/// A light that remembers its colour, and returns scenes under a new name.
class Light final : public room::LightServant {
 public:
  rpc::Result<void> set(const room::Colour& request, const rpc::CallContext&) override {
    colour_ = request;
    return {};
  }
  rpc::Result<room::Colour> get(const rpc::CallContext&) override { return colour_; }
  rpc::Result<void> scene(const room::Scene& request, rpc::ReplyBuilder<room::Scene>& reply,
                          const rpc::CallContext&) override {
    room::SceneT scene;
    request.UnPackTo(&scene);
    scene.name += " again";
    reply.finish(room::CreateScene(reply.builder(), &scene));
    return {};
  }
  rpc::Result<void> flash(const room::Colour& request, const rpc::CallContext&) override {
    colour_ = request;
    return {};
  }
  void fade(const room::Colour& request, rpc::StructWriter<room::Colour> items,
            const rpc::CallContext&) override {
    for (const float share : {1.0F, 0.5F, 0.25F})
      EXPECT_TRUE(items.write({request.red() * share, request.green() * share, 0}));
    if (request.red() >= 0) return items.finish();
    endless_ = std::move(items);
  }
  rpc::Result<room::Patience> patience(const rpc::CallContext& context) override {
    return room::Patience(
        std::chrono::duration<double>(context.deadline - context.received).count());
  }

 private:
  room::Colour colour_{};
  rpc::StructWriter<room::Colour> endless_{};
};

/// A server with a light and a catalog of it.
struct Room {
  Room() {
    auto created =
        rpc::Server::create({.lanes = {{.low = 0, .wait = {.strategy = rt::WaitStrategy::kBlock}}},
                             .realtime = rt::RealtimeMode::kOff});
    EXPECT_TRUE(created) << created.error().text();
    server = std::move(*created);
    catalog.add("room/light", light);
    EXPECT_TRUE(server->add("room/light", light));
    EXPECT_TRUE(catalog.serve(*server));
    EXPECT_TRUE(server->start());
  }
  ~Room() { server->stop(); }
  Room(const Room&) = delete;
  Room& operator=(const Room&) = delete;
  [[nodiscard]] std::string url(std::string_view path) const { return server->url(path); }

  Light light{};
  Catalog catalog{};
  std::unique_ptr<rpc::Server> server{};
};

}  // namespace rtpm::introspection::test
