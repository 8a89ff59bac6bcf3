#include "tests/support/textbook_frames.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <type_traits>

#include "mapjoin/graph/dual.h"

namespace mapjoin::test {

namespace {

template <int D>
inline constexpr int kTurn = D == 2 ? 1 : 3;

/// Rotation by a small vector: exact for numbers; to first order, which is all they hold, for duals
/// at zero.
template <int D, class S>
Mat<D, D, S> turn_by(const Eigen::Ref<const Eigen::Matrix<S, Eigen::Dynamic, 1>>& phi) {
  Mat<D, D, S> R = Mat<D, D, S>::Identity();
  if constexpr (std::is_same_v<S, double> && D == 2) {
    R = Eigen::Rotation2Dd(phi(0)).toRotationMatrix();
  } else if constexpr (std::is_same_v<S, double>) {
    const Eigen::Vector3d v = phi;
    if (v.norm() > 0.0) R = Eigen::AngleAxisd(v.norm(), v.normalized()).toRotationMatrix();
  } else if constexpr (D == 2) {
    R(0, 1) = -phi(0);
    R(1, 0) = phi(0);
  } else {
    R(0, 1) = -phi(2);
    R(1, 0) = phi(2);
    R(0, 2) = phi(1);
    R(2, 0) = -phi(1);
    R(1, 2) = -phi(0);
    R(2, 1) = phi(0);
  }
  return R;
}

template <int D>
int size_of(const Thing<D, double>& thing) {
  return thing.pose ? D + kTurn<D> : D;
}

/// x [+] d in the charts of DESIGN section 2.
template <int D, class S>
std::vector<Thing<D, S>> plus(const std::vector<Thing<D, double>>& x,
                              const Eigen::Matrix<S, Eigen::Dynamic, 1>& d) {
  std::vector<Thing<D, S>> out;
  Eigen::Index at = 0;
  for (const auto& thing : x) {
    Thing<D, S> moved;
    moved.pose = thing.pose;
    moved.R = thing.R.template cast<S>();
    const Vec<D, S> step = d.segment(at, D);
    if (thing.pose) {
      moved.t = thing.t.template cast<S>() + Vec<D, S>(moved.R * step);
      moved.R = Mat<D, D, S>(moved.R * turn_by<D, S>(d.segment(at + D, kTurn<D>)));
    } else {
      moved.t = thing.t.template cast<S>() + step;
    }
    at += size_of(thing);
    out.push_back(moved);
  }
  return out;
}

/// y [-] x for y next to x: to first order in the rotation.
template <int D, class S>
Eigen::Matrix<S, Eigen::Dynamic, 1> minus(const std::vector<Thing<D, S>>& y,
                                          const std::vector<Thing<D, double>>& x) {
  std::vector<S> out;
  for (std::size_t k = 0; k < x.size(); ++k) {
    const Mat<D, D, S> R = x[k].R.template cast<S>();
    Vec<D, S> step = y[k].t - Vec<D, S>(x[k].t.template cast<S>());
    if (x[k].pose) step = Vec<D, S>(R.transpose() * step);
    for (int i = 0; i < D; ++i) out.push_back(step(i));
    if (!x[k].pose) continue;
    const Mat<D, D, S> turn = R.transpose() * y[k].R;
    if constexpr (D == 2) {
      out.push_back((turn(1, 0) - turn(0, 1)) * S(0.5));
    } else {
      out.push_back((turn(2, 1) - turn(1, 2)) * S(0.5));
      out.push_back((turn(0, 2) - turn(2, 0)) * S(0.5));
      out.push_back((turn(1, 0) - turn(0, 1)) * S(0.5));
    }
  }
  return Eigen::Map<Eigen::Matrix<S, Eigen::Dynamic, 1>>(out.data(),
                                                         static_cast<Eigen::Index>(out.size()));
}

template <int D, class S>
Motion<D, S> motion(const TextbookFrame<D>& to, const std::vector<Thing<D, S>>& x) {
  const Thing<D, S>& origin = x[static_cast<std::size_t>(to.first)];
  Motion<D, S> out;
  out.R = origin.R.transpose();
  if constexpr (D == 2) {
    if (to.second >= 0) {
      using std::atan2;
      using std::cos;
      using std::sin;
      const Vec<2, S> axis = x[static_cast<std::size_t>(to.second)].t - origin.t;
      const S angle = atan2(axis(1), axis(0));
      out.R << cos(angle), sin(angle), -sin(angle), cos(angle);
    }
  }
  if constexpr (D == 3) {
    if (to.third >= 0) {  // (B.3), (B.4)
      const auto cross = [](const Vec<3, S>& a, const Vec<3, S>& b) {
        return Vec<3, S>(a(1) * b(2) - a(2) * b(1), a(2) * b(0) - a(0) * b(2),
                         a(0) * b(1) - a(1) * b(0));
      };
      const Vec<3, S> v1 = x[static_cast<std::size_t>(to.second)].t - origin.t;
      const Vec<3, S> v3 = cross(v1, x[static_cast<std::size_t>(to.third)].t - origin.t);
      const Vec<3, S> axes[3] = {v1, cross(v3, v1), v3};
      for (int k = 0; k < 3; ++k) {
        using std::sqrt;
        const S norm = sqrt(axes[k].dot(axes[k]));
        for (int s = 0; s < 3; ++s) out.R(k, s) = axes[k](s) / norm;
      }
    }
  }
  out.t = -Vec<D, S>(out.R * origin.t);
  return out;
}

template <int D, class S>
std::vector<Thing<D, S>> carried_by(const std::vector<Thing<D, S>>& x, const Motion<D, S>& T) {
  std::vector<Thing<D, S>> out = x;
  for (auto& thing : out) {
    thing.t = Vec<D, S>(T.R * thing.t) + T.t;
    if (thing.pose) thing.R = Mat<D, D, S>(T.R * thing.R);
  }
  return out;
}

}  // namespace

template <int D>
Motion<D, double> TextbookFrame<D>::into(const std::vector<Thing<D, double>>& x) const {
  return motion(*this, x);
}

template <int D>
std::vector<Thing<D, double>> moved(const std::vector<Thing<D, double>>& x,
                                    const Motion<D, double>& T) {
  return carried_by(x, T);
}

template <int D>
std::vector<Thing<D, double>> things_of(const Values<D>& values) {
  std::vector<Thing<D, double>> out;
  for (int i = 0; i < values.size(); ++i) {
    const Key key = values.variables().key(i);
    if (key.type == Tag("pose")) {
      out.push_back({true, values.pose(key).R, values.pose(key).t});
    } else {
      out.push_back({false, Mat<D, D>::Identity(), values.point(key)});
    }
  }
  return out;
}

template <int D>
TextbookFrame<D> frame_of(const Anchor<D>& anchor, const Values<D>& values) {
  TextbookFrame<D> out;
  out.first = values.variables().require(anchor.keys[0], "test");
  const int offset = values.variables().offset(out.first);
  for (int s = 0; s < values.variables().dim(out.first); ++s) out.pinned.push_back(offset + s);
  if (anchor.keys.size() >= 2) {
    out.second = values.variables().require(anchor.keys[1], "test");
    for (int s = 1; s < D; ++s) out.pinned.push_back(values.variables().offset(out.second) + s);
  }
  if (anchor.keys.size() == 3) {
    out.third = values.variables().require(anchor.keys[2], "test");
    out.pinned.push_back(values.variables().offset(out.third) + 2);
  }
  return out;
}

template <int D>
Eigen::MatrixXd nabla_by_duals(const std::vector<Thing<D, double>>& in_from,
                               const TextbookFrame<D>& to) {
  using S = Dual<1>;
  const auto there = carried_by(in_from, motion(to, in_from));
  int n = 0;
  for (const auto& thing : in_from) n += size_of(thing);
  Eigen::MatrixXd out(n, n);
  for (int k = 0; k < n; ++k) {
    Eigen::Matrix<S, Eigen::Dynamic, 1> d(n);
    for (int i = 0; i < n; ++i) d(i) = S(0.0);
    d(k) = S::variable(0.0, 0);
    const auto x = plus<D, S>(in_from, d);
    const auto r = minus<D, S>(carried_by(x, motion(to, x)), there);
    for (int i = 0; i < n; ++i) out(i, k) = r(i).v(0);
  }
  return out;
}

template <int D>
Eigen::MatrixXd nabla_by_differences(const std::vector<Thing<D, double>>& in_from,
                                     const TextbookFrame<D>& to) {
  constexpr double h = 1e-5;
  const auto there = carried_by(in_from, motion(to, in_from));
  int n = 0;
  for (const auto& thing : in_from) n += size_of(thing);
  Eigen::MatrixXd out(n, n);
  for (int k = 0; k < n; ++k) {
    Eigen::VectorXd side[2];
    for (const int s : {0, 1}) {
      Eigen::VectorXd d = Eigen::VectorXd::Zero(n);
      d(k) = s == 0 ? h : -h;
      const auto x = plus<D, double>(in_from, d);
      side[s] = minus<D, double>(carried_by(x, motion(to, x)), there);
    }
    out.col(k) = (side[0] - side[1]) / (2 * h);
  }
  return out;
}

Eigen::MatrixXd without(const Eigen::MatrixXd& M, const std::vector<int>& rows,
                        const std::vector<int>& columns) {
  const auto kept = [](Eigen::Index n, const std::vector<int>& dropped) {
    std::vector<int> out;
    for (int i = 0; i < n; ++i) {
      if (std::find(dropped.begin(), dropped.end(), i) == dropped.end()) out.push_back(i);
    }
    return out;
  };
  const std::vector<int> r = kept(M.rows(), rows), c = kept(M.cols(), columns);
  Eigen::MatrixXd out(static_cast<Eigen::Index>(r.size()), static_cast<Eigen::Index>(c.size()));
  for (std::size_t j = 0; j < c.size(); ++j) {
    for (std::size_t i = 0; i < r.size(); ++i)
      out(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = M(r[i], c[j]);
  }
  return out;
}

#define MAPJOIN_INSTANTIATE(D)                                                           \
  template struct TextbookFrame<D>;                                                      \
  template std::vector<Thing<D, double>> things_of<D>(const Values<D>&);                 \
  template TextbookFrame<D> frame_of<D>(const Anchor<D>&, const Values<D>&);             \
  template std::vector<Thing<D, double>> moved<D>(const std::vector<Thing<D, double>>&,  \
                                                  const Motion<D, double>&);             \
  template Eigen::MatrixXd nabla_by_duals<D>(const std::vector<Thing<D, double>>&,       \
                                             const TextbookFrame<D>&);                   \
  template Eigen::MatrixXd nabla_by_differences<D>(const std::vector<Thing<D, double>>&, \
                                                   const TextbookFrame<D>&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin::test
