// The features that Encke gives its support vector machine, computed once more, slowly, for checks and for libsvm.
#pragma once

#include "chain.hpp"

namespace reference {

/// Histograms of clusters as `services/extractor` defines them: normals by Eq. 4, angles by Eqs. 1 and 2, weights by
/// Eq. 3, neighbours by brute force.
Features same_features(const Cloud& cloud, const std::vector<pcl::PointIndices>& clusters,
                       const std::vector<int>& column, int stride);

}  // namespace reference
