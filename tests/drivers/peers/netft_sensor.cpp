// The fake sensor of netft-cpp as a process: prints its ports, then obeys lines on standard input.
#include <cstdlib>
#include <iostream>
#include <string>

#include "support/fake_sensor.hpp"

int main() {
  netft::test::FakeSensor sensor(1000.0);
  std::cout << sensor.rdt_port() << ' ' << sensor.http_port() << std::endl;
  std::string line;
  while (std::getline(std::cin, line)) {
    if (line == "pause") {
      sensor.pause();
    } else if (line == "resume") {
      sensor.resume();
    } else if (line.rfind("skip ", 0) == 0) {
      sensor.skip_rdt(static_cast<unsigned>(std::atoi(line.c_str() + 5)));
    } else if (line == "commands") {
      for (const auto command : sensor.commands()) {
        std::cout << static_cast<int>(command) << ' ';
      }
      std::cout << std::endl;
    }
  }
}
