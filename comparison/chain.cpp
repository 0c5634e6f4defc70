#include "chain.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <pcl/features/pfh_tools.h>

namespace reference {

std::vector<pcl::PointIndices> cluster(const Cloud::Ptr& cloud, float range_m, bool sorted, Tree::Ptr& tree) {
    tree.reset(new Tree(sorted));
    tree->setInputCloud(cloud);
    pcl::EuclideanClusterExtraction<pcl::PointXYZ> extraction;
    extraction.setClusterTolerance(range_m);
    extraction.setMinClusterSize(1);
    extraction.setSearchMethod(tree);
    extraction.setInputCloud(cloud);
    std::vector<pcl::PointIndices> clusters;
    extraction.extract(clusters);
    return clusters;
}

namespace {

/// Takes memory for the results.
void make_room(Patch& patch) {
    patch.normals.resize(patch.cloud->size());
    patch.near.resize(patch.points.size());
    patch.distance2.resize(patch.points.size());
}

/// The largest stride up to `wanted` at which some phase has enough points; 1 at the least.
int served_stride(const pcl::Indices& points, const std::vector<int>& column, int wanted) {
    for (int stride = wanted; stride > 1; --stride) {
        std::vector<std::size_t> count(stride, 0);
        for (int point : points) ++count[column[point] % stride];
        if (*std::max_element(count.begin(), count.end()) >= MIN_FEATURE_POINTS) return stride;
    }
    return 1;
}

}  // namespace

std::vector<Patch> whole(const Cloud::Ptr& cloud, const Tree::Ptr& tree,
                         const std::vector<pcl::PointIndices>& clusters) {
    std::vector<Patch> patches(1);
    Patch& patch = patches[0];
    patch.cloud = cloud;
    patch.tree = tree;
    patch.cluster_of.assign(cloud->size(), -1);
    int described = 0;
    for (const auto& cluster : clusters) {
        if (cluster.indices.size() < MIN_FEATURE_POINTS) continue;
        for (int point : cluster.indices) patch.cluster_of[point] = described;
        patch.points.insert(patch.points.end(), cluster.indices.begin(), cluster.indices.end());
        ++described;
    }
    make_room(patch);
    return patches;
}

std::vector<Patch> parts(const Cloud::Ptr& cloud, const std::vector<pcl::PointIndices>& clusters,
                         const std::vector<int>& column, int stride) {
    std::vector<Patch> patches;
    int described = 0;
    for (const auto& cluster : clusters) {
        if (cluster.indices.size() < MIN_FEATURE_POINTS) continue;
        const int served = served_stride(cluster.indices, column, stride);
        for (int phase = 0; phase < served; ++phase) {
            Patch patch;
            patch.cloud.reset(new Cloud);
            for (int point : cluster.indices)
                if (column[point] % served == phase) patch.cloud->push_back((*cloud)[point]);
            if (patch.cloud->size() < MIN_FEATURE_POINTS) continue;
            patch.cluster_of.assign(patch.cloud->size(), described);
            patch.points.resize(patch.cloud->size());
            std::iota(patch.points.begin(), patch.points.end(), 0);
            make_room(patch);
            patches.push_back(std::move(patch));
        }
        ++described;
    }
    return patches;
}

namespace {

void plant(Patch& patch) {
    if (patch.tree) return;
    patch.tree.reset(new Tree(false));
    patch.tree->setInputCloud(patch.cloud);
}

template <typename Estimation>
void estimate(std::vector<Patch>& patches, Estimation& estimation) {
    for (Patch& patch : patches) {
        plant(patch);
        pcl::PointCloud<pcl::Normal> normals;
        estimation.setSearchMethod(patch.tree);
        estimation.setInputCloud(patch.cloud);
        estimation.setIndices(pcl::IndicesConstPtr(&patch.points, [](const pcl::Indices*) {}));
        estimation.setKSearch(K);
        estimation.compute(normals);
        // PCL's face the sensor, the paper's face away.
        for (std::size_t i = 0; i < patch.points.size(); ++i)
            patch.normals[patch.points[i]] = -normals[i].getNormalVector4fMap();
    }
}

}  // namespace

void normals_by_estimation(std::vector<Patch>& patches) {
    pcl::NormalEstimation<pcl::PointXYZ, pcl::Normal> estimation;
    estimate(patches, estimation);
}

void normals_by_estimation_omp(std::vector<Patch>& patches) {
    pcl::NormalEstimationOMP<pcl::PointXYZ, pcl::Normal> estimation(1);
    estimate(patches, estimation);
}

void normals_kept(std::vector<Patch>& patches) {
    pcl::Indices near(K);
    std::vector<float> distance2(K);
    for (Patch& patch : patches) {
        plant(patch);
        for (std::size_t i = 0; i < patch.points.size(); ++i) {
            const int point = patch.points[i];
            const int found = patch.tree->nearestKSearch(*patch.cloud, point, K, near, distance2);
            for (int rank = 0; rank < K; ++rank) {
                patch.near[i][rank] = rank < found ? near[rank] : -1;
                patch.distance2[i][rank] = rank < found ? distance2[rank] : 0.0f;
            }
            Eigen::Vector4f plane;
            float curvature;
            pcl::computePointNormal(*patch.cloud, near, plane, curvature);
            pcl::flipNormalTowardsViewpoint((*patch.cloud)[point], 0.0f, 0.0f, 0.0f, plane[0], plane[1], plane[2]);
            patch.normals[point] = Eigen::Vector4f(-plane[0], -plane[1], -plane[2], 0.0f);
        }
    }
}

namespace {

void search(Patch& patch) {
    pcl::Indices near(K);
    std::vector<float> distance2(K);
    for (std::size_t i = 0; i < patch.points.size(); ++i) {
        const int found = patch.tree->nearestKSearch(*patch.cloud, patch.points[i], K, near, distance2);
        for (int rank = 0; rank < K; ++rank) {
            patch.near[i][rank] = rank < found ? near[rank] : -1;
            patch.distance2[i][rank] = rank < found ? distance2[rank] : 0.0f;
        }
    }
}

/// Level of a value in [low, high].
int level(float value, float low, float high) {
    return std::clamp(static_cast<int>((value - low) * (LEVELS / (high - low))), 0, LEVELS - 1);
}

/// Appends what a cluster's bins hold, scaled to sum 1, and empties them.
void take(std::vector<double>& bins, Features& features) {
    double total = 0.0;
    for (double weight : bins) total += weight;
    features.starts.push_back(features.nodes.size());
    for (int bin = 0; bin < BINS; ++bin) {
        if (bins[bin] == 0.0) continue;
        features.nodes.push_back({bin + 1, bins[bin] / total});
        bins[bin] = 0.0;
    }
    features.nodes.push_back({-1, 0.0});
}

}  // namespace

Features histograms(std::vector<Patch>& patches, std::size_t clusters, bool search_again) {
    Features features;
    features.starts.reserve(clusters);
    std::vector<double> bins(BINS, 0.0);
    std::vector<float> share;
    int open = 0;
    for (Patch& patch : patches) {
        if (search_again) search(patch);
        // With n_i the SPFH of point i, the sum of all FPFH (Eq. 3) is the sum of n_i (1 + (1/k) sum over l of 1 / w_li),
        // l the points that have i as a neighbour. So every SPFH is entered once, with a weight gathered before.
        share.assign(patch.cloud->size(), 1.0f);
        const auto is_pair = [&patch](int point, int other) {
            return other >= 0 && other != point && patch.cluster_of[other] == patch.cluster_of[point];
        };
        for (std::size_t i = 0; i < patch.points.size(); ++i) {
            const int point = patch.points[i];
            int others = 0;
            for (int other : patch.near[i]) others += is_pair(point, other);
            for (int rank = 0; rank < K; ++rank)
                if (const int other = patch.near[i][rank]; is_pair(point, other))
                    share[other] += 1.0f / (std::max(std::sqrt(patch.distance2[i][rank]), MIN_DISTANCE_M) * others);
        }
        for (std::size_t i = 0; i < patch.points.size(); ++i) {
            const int point = patch.points[i];
            for (; open < patch.cluster_of[point]; ++open) take(bins, features);
            const Eigen::Vector4f here = (*patch.cloud)[point].getVector4fMap();
            for (int other : patch.near[i]) {
                if (!is_pair(point, other)) continue;
                const Eigen::Vector4f there = (*patch.cloud)[other].getVector4fMap();
                float theta, alpha, phi, distance;
                if (!pcl::computePairFeatures(here, patch.normals[point], there, patch.normals[other], theta, alpha,
                                              phi, distance))
                    continue;
                const float pi = static_cast<float>(M_PI);
                const int bin = (level(alpha, -1.0f, 1.0f) * LEVELS + level(phi, -1.0f, 1.0f)) * LEVELS +
                                level(theta, -pi, pi);
                bins[bin] += share[point];
            }
        }
    }
    for (; open < static_cast<int>(clusters); ++open) take(bins, features);
    return features;
}

std::vector<int> predict(const svm_model* model, const Features& features) {
    std::vector<int> classes(features.size());
    for (std::size_t i = 0; i < features.size(); ++i)
        classes[i] = static_cast<int>(svm_predict(model, &features.nodes[features.starts[i]]));
    return classes;
}

}  // namespace reference
