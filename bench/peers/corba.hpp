#pragma once

#include <omniORB4/CORBA.h>

#include <utility>

#include "peer.hpp"

/// The code that the peers omniORB and omniEvents share.
namespace rtpm::bench {

/// Runs `body` and turns CORBA's exceptions into errors, for Peer::guard.
inline Outcome guard_corba(const std::function<Outcome()>& body) {
  try {
    return body();
  } catch (const CORBA::Exception& exception) {
    return unexpected{std::string("CORBA's ") + exception._name()};
  }
}

/// Starts this process's ORB with these options and ones that keep every connection.
inline CORBA::ORB_var start_orb(std::vector<std::pair<std::string, std::string>> options) {
  options.emplace_back("threadPerConnectionUpperLimit", "10000");
  options.emplace_back("scanGranularity", "0");
  std::vector<std::array<const char*, 2>> texts;
  for (const auto& [key, value] : options)
    texts.push_back({key.c_str(), value.c_str()});
  texts.push_back({nullptr, nullptr});
  int argument_count = 0;
  return CORBA::ORB_init(argument_count, nullptr, "omniORB4",
                         reinterpret_cast<const char*(*)[2]>(texts.data()));
}

/// The object adapter of that name, with its manager active.
inline PortableServer::POA_var activate_adapter(CORBA::ORB_ptr orb, const char* name) {
  const CORBA::Object_var object = orb->resolve_initial_references(name);
  const PortableServer::POA_var adapter = PortableServer::POA::_narrow(object);
  const PortableServer::POAManager_var manager = adapter->the_POAManager();
  manager->activate();
  return adapter;
}

}  // namespace rtpm::bench
