// The reference chain: each step as PCL offers it, on one thread.
#pragma once

#include <array>
#include <vector>

#include <pcl/common/common.h>
#include <pcl/features/normal_3d.h>
#include <pcl/features/normal_3d_omp.h>
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>
#include <pcl/search/kdtree.h>
#include <pcl/segmentation/extract_clusters.h>

#include <libsvm/svm.h>

namespace reference {

using Cloud = pcl::PointCloud<pcl::PointXYZ>;
using Tree = pcl::search::KdTree<pcl::PointXYZ>;

/// Points of a neighbourhood, the point itself included.
constexpr int K = 5;
/// Smaller clusters have no features.
constexpr std::size_t MIN_FEATURE_POINTS = 5;
/// Levels of each angle, and joint bins.
constexpr int LEVELS = 12;
constexpr int BINS = LEVELS * LEVELS * LEVELS;
/// Neighbours nearer than this count as this far [m], as in Encke.
constexpr float MIN_DISTANCE_M = 1e-3f;

/// Sparse feature vectors, each ended by an index of -1.
struct Features {
    std::vector<svm_node> nodes;
    std::vector<std::size_t> starts;
    std::size_t size() const { return starts.size(); }
};

/// Clusters of points nearer than `range_m` to another, any size, and the tree that found them.
/// A tree that sorts what it finds does so in vain; PCL serves both.
std::vector<pcl::PointIndices> cluster(const Cloud::Ptr& cloud, float range_m, bool sorted, Tree::Ptr& tree);

/// Points whose neighbours are searched for together.
struct Patch {
    Cloud::Ptr cloud;
    Tree::Ptr tree;
    /// Cluster of each point, -1 for one without features.
    std::vector<int> cluster_of;
    /// The points with features, cluster after cluster.
    pcl::Indices points;
    /// One for each of the cloud's points, away from the sensor; unit length.
    std::vector<Eigen::Vector4f> normals;
    /// K for each of `points`; -1 where there are fewer.
    std::vector<std::array<int, K>> near;
    std::vector<std::array<float, K>> distance2;
};

/// One patch of the whole cloud, with the tree that clustered it.
std::vector<Patch> whole(const Cloud::Ptr& cloud, const Tree::Ptr& tree,
                         const std::vector<pcl::PointIndices>& clusters);

/// A patch, with a tree of its own, for each phase of each cluster, as Encke's extractor has them: finer columns than
/// the paper's 500 are read in strides. `column`: of each point.
std::vector<Patch> parts(const Cloud::Ptr& cloud, const std::vector<pcl::PointIndices>& clusters,
                         const std::vector<int>& column, int stride);

/// pcl::NormalEstimation; the neighbours that it finds are lost. Builds the trees that are not there yet.
void normals_by_estimation(std::vector<Patch>& patches);
/// The same by pcl::NormalEstimationOMP with one thread.
void normals_by_estimation_omp(std::vector<Patch>& patches);
/// What pcl::NormalEstimation does for each point, with its neighbours kept.
void normals_kept(std::vector<Patch>& patches);

/// The joint histogram of each cluster: the sum of its points' FPFH (Eq. 3 of the paper), scaled to sum 1. The angles
/// are pcl::computePairFeatures'. Neighbours are searched for again, as pcl::FPFHEstimation does, or taken as kept.
Features histograms(std::vector<Patch>& patches, std::size_t clusters, bool search_again);

/// The class of each feature vector.
std::vector<int> predict(const svm_model* model, const Features& features);

}  // namespace reference
