// Track track(std::ifstream("film.json"));  colour *= track.scale_at(seconds);
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

struct Track {
    std::string text;
    std::vector<double> times, factors;
    double gamma;
    explicit Track(std::ifstream file)
        : text(std::istreambuf_iterator<char>(file), {}), times(numbers("\"times_s\"")),
          factors(numbers("\"factors\"")), gamma(numbers("\"gamma\"")[0]) {}
    double factor_at(double time) const { // of the last frame that begins no later; before the first, of the first
        const auto after = std::upper_bound(times.begin() + 1, times.end(), time);
        return factors[after - times.begin() - 1];
    }
    double scale_at(double time) const { return std::pow(factor_at(time), 1 / gamma); } // of gamma-encoded values
    std::vector<double> numbers(const std::string& key) const {
        const char* at = text.c_str() + text.find_first_of("0123456789", text.find(key) + key.size());
        std::vector<double> found;
        for (char* end = nullptr;; at = end + 1) {
            found.push_back(std::strtod(at, &end));
            if (*end != ',') return found;
        }
    }
};
