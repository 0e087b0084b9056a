#pragma once

#include <string>
#include <utility>

#include "rtpm/names/resolver.hpp"
#include "rtpm/rpc/node.hpp"

/// A program's node, with the names that it resolves.
struct rtpm_node {
  rtpm_node(std::string names_at, rtpm::rpc::NodeConfig config)
      : where(std::move(names_at)), node(std::move(config)), resolver(node, where) {
    node.use(resolver);
  }
  ~rtpm_node() { node.forget(resolver); }
  rtpm_node(const rtpm_node&) = delete;
  rtpm_node& operator=(const rtpm_node&) = delete;

  std::string where;
  rtpm::rpc::Node node;
  rtpm::names::RegistryResolver resolver;
};
