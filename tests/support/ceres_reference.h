// Nonlinear least squares over poses and points by Ceres, written from the definitions of DESIGN
// sections 2 and 3 and nothing of the library's own: what joins must agree with.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "mapjoin/graph/map.h"
#include "mapjoin/graph/measurement_graph.h"

namespace mapjoin::test {

template <int D>
class CeresReference {
 public:
  static constexpr int kTurn = D == 2 ? 1 : 3;

  CeresReference() = default;
  explicit CeresReference(const MeasurementGraph<D>& graph) { add(graph); }

  /// Observations in the frames of poses or of points; terms may repeat a key.
  void add(const LocalMap<D>& map);
  void add(const MeasurementGraph<D>& graph);

  /// The minimum near `start`, with one pose held.
  Values<D> minimise(Values<D> start, const Key& held) const;

  struct Normal {
    double chi2 = 0.0;
    Eigen::MatrixXd H;  ///< J^T I J over all scalars, in the library's charts at the given values
    Eigen::VectorXd b;  ///< -J^T I r
  };
  Normal normal_equations(const Values<D>& x) const;
  double chi2(const Values<D>& x) const;

  /// A pose or a point.
  struct State {
    Eigen::Matrix<double, D, D> R = Eigen::Matrix<double, D, D>::Identity();
    Eigen::Matrix<double, D, 1> t = Eigen::Matrix<double, D, 1>::Zero();
    bool pose = false;
  };
  struct Observation {
    std::vector<Key> anchor;
    std::vector<Key> terms;
    std::vector<State> measured;
    Eigen::MatrixXd root;  // root^T root is the information
  };

 private:
  void polish(Values<D>& x, const Key& held) const;

  std::vector<Observation> observations_;
};

extern template class CeresReference<2>;
extern template class CeresReference<3>;

}  // namespace mapjoin::test
