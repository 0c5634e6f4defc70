// Compiled without contraction of products and sums, so that it rounds as Encke does.
#include "same_features.hpp"

#include <algorithm>
#include <cmath>

namespace reference {
namespace {

using Point = std::array<float, 3>;
using Vector = std::array<double, 3>;

struct Near {
    float distance2;
    int index;
    bool operator<(const Near& other) const {
        return distance2 != other.distance2 ? distance2 < other.distance2 : index < other.index;
    }
};

template <typename T>
T dot(const std::array<T, 3>& a, const std::array<T, 3>& b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

template <typename T>
std::array<T, 3> cross(const std::array<T, 3>& a, const std::array<T, 3>& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

std::vector<Near> neighbours(const std::vector<Point>& points, int of) {
    std::vector<Near> near;
    for (int i = 0; i < static_cast<int>(points.size()); ++i) {
        if (i == of) continue;
        const float dx = points[of][0] - points[i][0], dy = points[of][1] - points[i][1],
                    dz = points[of][2] - points[i][2];
        const Near candidate{(dx * dx + dy * dy) + dz * dz, i};
        if (near.size() == K - 1 && !(candidate < near.back())) continue;
        if (near.size() == K - 1) near.pop_back();
        near.insert(std::upper_bound(near.begin(), near.end(), candidate), candidate);
    }
    return near;
}

/// Eq. 4 as adj(S) c, with the mean c and the scatter S.
Point normal(const std::vector<Point>& points, int of, const std::vector<Near>& near) {
    const Vector here{points[of][0], points[of][1], points[of][2]};
    std::vector<Vector> offsets{{0.0, 0.0, 0.0}};
    for (const Near& other : near) {
        const Point& p = points[other.index];
        offsets.push_back({p[0] - here[0], p[1] - here[1], p[2] - here[2]});
    }
    Vector mean{};
    for (const Vector& offset : offsets)
        for (int axis = 0; axis < 3; ++axis) mean[axis] += offset[axis];
    for (double& entry : mean) entry /= static_cast<double>(offsets.size());
    double xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0;
    for (const Vector& offset : offsets) {
        const double x = offset[0] - mean[0], y = offset[1] - mean[1], z = offset[2] - mean[2];
        xx += x * x, xy += x * y, xz += x * z, yy += y * y, yz += y * z, zz += z * z;
    }
    const Vector centre{here[0] + mean[0], here[1] + mean[1], here[2] + mean[2]};
    const Vector a{yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy};
    const Vector b{a[1], xx * zz - xz * xz, xy * xz - xx * yz};
    const Vector d{a[2], b[2], xx * yy - xy * xy};
    const Vector n{dot(a, centre), dot(b, centre), dot(d, centre)};
    const double trace = xx + yy + zz, length = std::sqrt(dot(n, n));
    if (length <= 1e-9 * trace * trace * std::sqrt(dot(centre, centre)) || !std::isnormal(length)) {
        const double away = std::sqrt(dot(here, here));
        if (!std::isnormal(away)) return {0.0f, 0.0f, 1.0f};
        return {float(here[0] / away), float(here[1] / away), float(here[2] / away)};
    }
    const double sign = dot(n, centre) < 0.0 ? -1.0 : 1.0;
    return {float(sign * n[0] / length), float(sign * n[1] / length), float(sign * n[2] / length)};
}

float snapped(float sine) { return std::abs(sine) < 1e-3f ? 0.0f : sine; }

int sine_level(float value) { return std::min(int(std::max((value + 1.0f) * 6.0f, 0.0f)), LEVELS - 1); }

int angle_level(float sine, float cosine) {
    const float c30 = 0.8660254f, s30 = 0.5f, height = std::abs(sine);
    int steps = 0;
    for (auto [es, ec] : {std::pair{s30, c30}, {c30, s30}, {1.0f, 0.0f}, {c30, -s30}, {s30, -c30}})
        steps += height * ec - cosine * es >= 0.0f;
    return sine >= 0.0f ? LEVELS / 2 + steps : LEVELS / 2 - 1 - steps;
}

/// Joint bin of a pair (Eqs. 1 and 2), -1 for one without angles.
int joint_bin(const Point& ni, const Point& nj, const Point& pi, const Point& pj, float distance) {
    if (distance <= 0.0f) return -1;
    const Point towards{(pj[0] - pi[0]) / distance, (pj[1] - pi[1]) / distance, (pj[2] - pi[2]) / distance};
    const Point across = cross(towards, ni);
    const float length = std::sqrt(dot(across, across));
    if (length < 1e-6f) return -1;
    const Point v{across[0] / length, across[1] / length, across[2] / length};
    const Point w = cross(ni, v);
    const int alpha = sine_level(snapped(dot(v, nj))), phi = sine_level(snapped(dot(ni, towards)));
    return (alpha * LEVELS + phi) * LEVELS + angle_level(snapped(dot(w, nj)), dot(ni, nj));
}

void add(const std::vector<Point>& points, std::vector<double>& bins) {
    const int count = static_cast<int>(points.size());
    std::vector<std::vector<Near>> near(count);
    std::vector<Point> normals(count);
    for (int i = 0; i < count; ++i) {
        near[i] = neighbours(points, i);
        normals[i] = normal(points, i, near[i]);
    }
    std::vector<float> share(count, 1.0f);
    for (int i = 0; i < count; ++i)
        for (const Near& other : near[i])
            share[other.index] += 1.0f / (std::max(std::sqrt(other.distance2), MIN_DISTANCE_M) * float(near[i].size()));
    for (int i = 0; i < count; ++i)
        for (const Near& other : near[i]) {
            const int bin = joint_bin(normals[i], normals[other.index], points[i], points[other.index],
                                      std::sqrt(other.distance2));
            if (bin >= 0) bins[bin] += share[i];
        }
}

}  // namespace

Features same_features(const Cloud& cloud, const std::vector<pcl::PointIndices>& clusters,
                       const std::vector<int>& column, int stride) {
    Features features;
    std::vector<double> bins(BINS);
    for (const auto& cluster : clusters) {
        if (cluster.indices.size() < MIN_FEATURE_POINTS) continue;
        pcl::Indices members = cluster.indices;
        std::sort(members.begin(), members.end());
        const auto phase_of = [&](int stride, int phase) {
            std::vector<Point> points;
            for (int member : members)
                if (column[member] % stride == phase)
                    points.push_back({cloud[member].x, cloud[member].y, cloud[member].z});
            return points;
        };
        std::fill(bins.begin(), bins.end(), 0.0);
        bool served = false;
        // The largest stride at which some phase has enough points.
        for (int step = stride; step > 0 && !served; --step)
            for (int phase = 0; phase < step; ++phase)
                if (const auto points = phase_of(step, phase); points.size() >= MIN_FEATURE_POINTS) {
                    add(points, bins);
                    served = true;
                }
        double total = 0.0;
        for (double weight : bins) total += weight;
        features.starts.push_back(features.nodes.size());
        for (int bin = 0; bin < BINS; ++bin)
            // A single-precision number in Encke's messages.
            if (bins[bin] != 0.0) features.nodes.push_back({bin + 1, float(bins[bin] * (1.0 / total))});
        features.nodes.push_back({-1, 0.0});
    }
    return features;
}

}  // namespace reference
