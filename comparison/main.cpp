// Times PCL and libsvm on one sweep and prints a JSON line for each stage and variant.
//
//   reference MODEL.libsvm SWEEP.csv COLUMNS RANGE_M RUNS RESULTS.csv
//
// RESULTS.csv gets a line `return,cluster,class` for each return: the smallest index of a return in its cluster as PCL
// found it, and the class that libsvm gives the features that Encke extracts of it (0: fewer than five points).

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <iostream>
#include <sstream>
#include <string>

#include "chain.hpp"
#include "same_features.hpp"

using namespace reference;

namespace {

[[noreturn]] void refuse(const std::string& cause) {
    std::cerr << "reference: " << cause << "\n";
    std::exit(2);
}

struct Sweep {
    Cloud::Ptr cloud{new Cloud};
    std::vector<int> column;
};

/// Reads `x,y,z,intensity,ring,azimuth_deg,time_ns`. Columns are numbered from the first that has a return.
Sweep read(const std::string& path, int columns) {
    std::ifstream file(path);
    if (!file) refuse(path + ": cannot be read");
    Sweep sweep;
    std::string line;
    std::getline(file, line);
    const std::string expected = "x,y,z,intensity,ring,azimuth_deg,time_ns";
    if (line != expected) refuse(path + ": has the columns " + line + ", must have " + expected);
    double before_deg = 0.0;
    int column = 0;
    while (std::getline(file, line)) {
        float x, y, z;
        double azimuth_deg;
        if (std::sscanf(line.c_str(), "%f,%f,%f,%*[^,],%*[^,],%lf", &x, &y, &z, &azimuth_deg) != 4)
            refuse(path + ": not a return: " + line);
        if (!sweep.cloud->empty()) {
            double ahead_deg = std::fmod(before_deg - azimuth_deg, 360.0); // the head turns clockwise
            if (ahead_deg < 0.0) ahead_deg += 360.0;
            if (azimuth_deg != before_deg) column += std::max(1, int(std::lround(ahead_deg * columns / 360.0)));
        }
        before_deg = azimuth_deg;
        sweep.cloud->push_back({x, y, z});
        sweep.column.push_back(column);
    }
    return sweep;
}

class Bench {
public:
    Bench(std::string sweep, float range_m, std::size_t returns, int runs)
        : sweep_(std::move(sweep)), range_m_(range_m), returns_(returns), runs_(runs) {}

    /// Runs the work once untimed, then `runs` times, or less often. `before` is not timed.
    void time(const char* stage, const char* variant, const std::function<void()>& work,
              const std::function<void()>& before = [] {}, int at_most = 1 << 20) const {
        std::vector<double> ms;
        for (int run = 0; run <= std::min(runs_, at_most); ++run) {
            before();
            const auto started = std::chrono::steady_clock::now();
            work();
            const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - started;
            if (run > 0) ms.push_back(took.count());
        }
        std::sort(ms.begin(), ms.end());
        const double median = (ms[(ms.size() - 1) / 2] + ms[ms.size() / 2]) / 2.0;
        std::printf("{\"who\":\"pcl\",\"stage\":\"%s\",\"variant\":\"%s\",\"sweep\":\"%s\",\"range_m\":%g,\"n\":%zu,"
                    "\"median_ms\":%.5f,\"min_ms\":%.5f}\n",
                    stage, variant, sweep_.c_str(), range_m_, returns_, median, ms[0]);
    }

private:
    std::string sweep_;
    float range_m_;
    std::size_t returns_;
    int runs_;
};

std::string stem(const std::string& path) {
    const std::size_t slash = path.find_last_of('/');
    const std::string name = slash == std::string::npos ? path : path.substr(slash + 1);
    return name.substr(0, name.find_last_of('.'));
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 7) refuse("MODEL.libsvm SWEEP.csv COLUMNS RANGE_M RUNS RESULTS.csv");
    const int columns = std::atoi(argv[3]), runs = std::max(1, std::atoi(argv[5]));
    const float range_m = std::atof(argv[4]);
    if (columns < 1 || !(range_m > 0.0f)) refuse("COLUMNS and RANGE_M must be above 0");
    svm_model* model = svm_load_model(argv[1]);
    if (!model) refuse(std::string(argv[1]) + ": not a model of libsvm");
    const Sweep sweep = read(argv[2], columns);
    const Cloud::Ptr& cloud = sweep.cloud;
    // As near to the paper's 500 columns a turn as whole strides come.
    const int stride = std::max(1, int(std::lround(columns / 500.0)));
    const Bench bench(stem(argv[2]), range_m, cloud->size(), runs);

    Tree::Ptr tree;
    std::vector<pcl::PointIndices> clusters;
    // PCL's default, and several times slower: shown, not used.
    bench.time("cluster", "tree that sorts", [&] { clusters = cluster(cloud, range_m, true, tree); }, [] {}, 1);
    bench.time("cluster", "tree that does not sort", [&] { clusters = cluster(cloud, range_m, false, tree); });
    std::size_t described = 0;
    for (const auto& found : clusters) described += found.indices.size() >= MIN_FEATURE_POINTS;

    std::vector<Patch> patches;
    const auto of_whole = [&] { patches = whole(cloud, tree, clusters); };
    const auto of_parts = [&] { patches = parts(cloud, clusters, sweep.column, stride); };
    bench.time("normals", "NormalEstimation", [&] { normals_by_estimation(patches); }, of_whole);
    bench.time("normals", "NormalEstimationOMP, one thread", [&] { normals_by_estimation_omp(patches); }, of_whole);
    bench.time("normals", "computePointNormal, neighbours kept", [&] { normals_kept(patches); }, of_whole);
    bench.time("normals", "the same, a tree for each of Encke's patches", [&] { normals_kept(patches); }, of_parts);

    Features features;
    const auto histograms_kept = [&] { features = histograms(patches, described, false); };
    const auto histograms_again = [&] { features = histograms(patches, described, true); };
    bench.time("histogram", "neighbours kept, Encke's patches", histograms_kept);
    of_whole();
    normals_kept(patches);
    bench.time("histogram", "neighbours kept", histograms_kept);
    bench.time("histogram again", "neighbours searched for again", histograms_again);

    const Features same = same_features(*cloud, clusters, sweep.column, stride);
    std::vector<int> classes;
    bench.time("svm", "svm_predict", [&] { classes = predict(model, same); });

    std::vector<int> root(cloud->size(), -1), class_of_root(cloud->size(), 0);
    std::size_t place = 0;
    for (const auto& found : clusters) {
        const int first = *std::min_element(found.indices.begin(), found.indices.end());
        for (int point : found.indices) root[point] = first;
        if (found.indices.size() >= MIN_FEATURE_POINTS) class_of_root[first] = classes[place++];
    }

    const auto chain = [&](bool in_parts) {
        clusters = cluster(cloud, range_m, false, tree);
        in_parts ? of_parts() : of_whole();
        normals_kept(patches);
        features = histograms(patches, described, false);
        classes = predict(model, features);
    };
    bench.time("paper_chain", "whole cloud", [&] { chain(false); });
    bench.time("paper_chain", "Encke's patches", [&] { chain(true); });

    std::ofstream results(argv[6]);
    results << "return,cluster,class\n";
    for (std::size_t point = 0; point < cloud->size(); ++point)
        results << point << ',' << root[point] << ',' << (root[point] < 0 ? 0 : class_of_root[root[point]]) << '\n';
    results.close();
    if (!results) refuse(std::string(argv[6]) + ": cannot be written");
    std::printf("{\"who\":\"pcl\",\"stage\":\"found\",\"sweep\":\"%s\",\"range_m\":%g,\"n\":%zu,\"clusters\":%zu,"
                "\"described\":%zu,\"support_vectors\":%d}\n",
                stem(argv[2]).c_str(), range_m, cloud->size(), clusters.size(), described, model->l);
    svm_free_and_destroy_model(&model);
}
