// netft-cpp's client as a process: streams for a second, biases, streams again; prints what it saw.
// Its discovery over HTTP, which needs libcurl, is replaced by the answer it would get.
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <iostream>
#include <thread>

#include "detail/xml_config.hpp"
#include "netft/client.hpp"
#include "netft/discovery.hpp"

namespace netft {
SensorConfiguration discover_sensor(const DiscoveryOptions &) {
  return detail::parse_sensor_configuration(
      "<netft><prodname>F</prodname><cfgcpf>1000000</cfgcpf><cfgcpt>1000000</cfgcpt>"
      "<scfgfu>N</scfgfu><scfgtu>Nm</scfgtu></netft>");
}
}  // namespace netft

int main(int, char **words) {
  netft::Config config;
  config.sensor_host = "127.0.0.1";
  config.rdt_port = std::atoi(words[1]);
  netft::Client client(config);
  std::atomic<long> samples{0};
  client.start([&](const netft::Sample &sample) {
    if (samples++ == 0) {
      for (const double value : sample.force) std::cout << value << ' ';
      for (const double value : sample.torque) std::cout << value << ' ';
      std::cout << std::endl;
    }
  });
  const bool came = client.wait_for_first_sample(std::chrono::duration<double>(10.0));
  std::this_thread::sleep_for(std::chrono::seconds(1));
  const long before = samples;
  client.bias();
  std::this_thread::sleep_for(std::chrono::seconds(1));
  std::cout << came << ' ' << before << ' ' << samples << ' ' << client.faulted() << std::endl;
  client.stop();
}
