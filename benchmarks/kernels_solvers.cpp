// Linear algebra, step by step: what a solve of the whole world is made of, and CHOLMOD beside it.
#include <benchmark/benchmark.h>

#include <numeric>
#include <optional>

#include "benchmarks/worlds.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/graph/index.h"
#include "mapjoin/solvers/observation_system.h"
#include "mapjoin/solvers/sparse_cholesky.h"

namespace mapjoin::benchmarks {

namespace {

/// All observations of a world at its optimum, as a system to solve.
template <int D>
struct WholeSystem {
  const MeasurementGraph<D>& graph;
  Piece<D> piece;
  Places places;
  ObservationSystem<D> system;

  explicit WholeSystem(const SolvedWorld<D>& world)
      : graph(world.graph),
        piece(whole_piece(world)),
        places(graph.variables.size()),
        system(graph, piece, {}, places) {}

  static Piece<D> whole_piece(const SolvedWorld<D>& world) {
    Piece<D> out = to_piece(world.graph.variables, world.map.values);
    out.observations.resize(world.graph.size());
    std::iota(out.observations.begin(), out.observations.end(), std::int64_t{0});
    return out;
  }
};

/// Residuals, Jacobians and their normal equations, each measurement into the same small matrix:
/// arithmetic alone, without the memory of the fronts.
template <int D>
void linearize(benchmark::State& state) {
  constexpr int kRows = 2 * kGauge<D>;
  const SolvedWorld<D>& world = SolvedWorld<D>::of_size(state.range(0));
  const RelativeMeasurements<D>& measured = world.graph.relative.at(0);
  const std::size_t n = measured.size();
  std::vector<std::int32_t> id(n), slots, offsets;
  std::iota(id.begin(), id.end(), 0);
  for (std::size_t e = 0; e < n; ++e) {
    slots.insert(slots.end(), {measured.from[e], measured.to[e]});
    offsets.insert(offsets.end(), {0, kGauge<D>});
  }
  RelativeBatch<D> batch;
  batch.size = n;
  batch.id = id.data();
  batch.z = measured.z.data();
  batch.info = measured.info.data();
  batch.poses = batch.values = world.map.values.data(0);
  batch.slots = slots.data();
  batch.offsets = offsets.data();
  Eigen::MatrixXd H(kRows + 1, kRows);
  const DenseTarget target{H.data(), kRows + 1, kRows, nullptr, 0, kRows};
  for (auto _ : state) {
    H.setZero();
    benchmark::DoNotOptimize(measured.kind->linearize_relative(batch, target));
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(n));
}
MAPJOIN_KERNEL(linearize);

template <int D>
void evaluate_chi2(benchmark::State& state) {
  WholeSystem<D> whole(SolvedWorld<D>::of_size(state.range(0)));
  WorkerPool pool;
  for (auto _ : state) benchmark::DoNotOptimize(whole.system.chi2(whole.piece, pool));
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(whole.graph.size()));
}
MAPJOIN_KERNEL(evaluate_chi2);

/// The gauge-free information matrix of the result.
template <int D>
void assemble_information(benchmark::State& state) {
  const WholeSystem<D> whole(SolvedWorld<D>::of_size(state.range(0)));
  for (auto _ : state) benchmark::DoNotOptimize(whole.system.information(whole.piece).blocks());
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(whole.graph.size()));
}
MAPJOIN_KERNEL(assemble_information);

/// Ordering, analysis and the lists that assembly goes by.
template <int D>
void plan_system(benchmark::State& state) {
  WholeSystem<D> whole(SolvedWorld<D>::of_size(state.range(0)));
  for (auto _ : state) {
    const ObservationSystem<D> system(whole.graph, whole.piece, {}, whole.places);
    benchmark::DoNotOptimize(system.statistics().fronts);
  }
  state.SetItemsProcessed(state.iterations() * whole.piece.size());
}
MAPJOIN_KERNEL(plan_system);

/// A whole linear solve on a plan: assembly, factorisation, substitution.
template <int D>
void step_of_system(benchmark::State& state) {
  WholeSystem<D> whole(SolvedWorld<D>::of_size(state.range(0)));
  WorkerPool pool;
  FrontalCholesky cholesky;
  Eigen::VectorXd d;
  for (auto _ : state) {
    if (!whole.system.solve(whole.piece, cholesky, pool, d).ok())
      throw Error("the world's system is singular");
  }
  state.counters["GFlop/s"] = benchmark::Counter(whole.system.statistics().flops * 1e-9,
                                                 benchmark::Counter::kIsIterationInvariantRate);
}
MAPJOIN_KERNEL(step_of_system);

template <int D>
void order(benchmark::State& state, OrderingMethod method) {
  const SolvedWorld<D>& world = SolvedWorld<D>::of_size(state.range(0));
  const CliqueList list = cliques(world.graph);
  const std::vector<int> dims = world.graph.variables.dims();
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        order_blocks(dims, {list.start, list.variables}, {.method = method}).data());
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(dims.size()));
}
template <int D>
void order_by_minimum_degree(benchmark::State& state) {
  order<D>(state, OrderingMethod::kMinimumDegree);
}
template <int D>
void order_by_nested_dissection(benchmark::State& state) {
  order<D>(state, OrderingMethod::kNestedDissection);
}
MAPJOIN_KERNEL(order_by_minimum_degree);
MAPJOIN_KERNEL(order_by_nested_dissection);

template <int D>
void analyze_fronts(benchmark::State& state) {
  const SolvedWorld<D>& world = SolvedWorld<D>::of_size(state.range(0));
  const CliqueList list = cliques(world.graph);
  const std::vector<int> dims = world.graph.variables.dims();
  const Cliques view{list.start, list.variables};
  const auto elimination = order_blocks(dims, view);
  for (auto _ : state) benchmark::DoNotOptimize(analyze(dims, view, elimination).fronts.data());
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(dims.size()));
}
MAPJOIN_KERNEL(analyze_fronts);

/// The information matrix of a world's optimum with the first pose stiffened, as a problem for the
/// fronts: every block a clique of its own, numbers ready.
struct Fronts {
  const SymmetricBlockMatrix& matrix;
  Eigen::VectorXd b;
  std::vector<std::int64_t> start{0};
  std::vector<std::int32_t> variables;
  std::vector<std::int64_t> slot;  // of each clique
  std::vector<std::int32_t> dims;
  FrontalStructure structure;
  FrontalCholesky cholesky;
  WorkerPool pool;

  explicit Fronts(const SymmetricBlockMatrix& information, int threads = 1)
      : matrix(information),
        b(Eigen::VectorXd::LinSpaced(matrix.scalars(), -1.0, 1.0)),
        pool(threads) {
    for (int j = 0; j < matrix.size(); ++j) {
      dims.push_back(matrix.dim(j));
      for (std::int64_t s = matrix.begin(j); s < matrix.end(j); ++s) {
        if (matrix.row(s) != j) variables.push_back(matrix.row(s));
        variables.push_back(j);
        start.push_back(static_cast<std::int64_t>(variables.size()));
        slot.push_back(s);
      }
    }
    const Cliques view{start, variables};
    structure = analyze(dims, view, order_blocks(dims, view));
  }

  void factorize() {
    const auto assemble = [&](std::int32_t front, const FrontView& view) {
      for (const std::int64_t k : structure.owned_by(front)) {
        const auto rows = structure.clique_rows(k);
        const std::int32_t j = variables[at(start[at(k) + 1] - 1)];
        const int n = matrix.dim(j);
        const Eigen::Map<const Eigen::MatrixXd> block(matrix.block(slot[at(k)]),
                                                      matrix.dim(matrix.row(slot[at(k)])), n);
        view.add(rows.front(), rows.back(), block);
        if (rows.size() > 1) continue;
        view.add_rhs(rows[0], b.segment(matrix.offset(j), n));
        if (j == 0) view.add(rows[0], rows[0], Eigen::MatrixXd(block.diagonal().asDiagonal()));
      }
    };
    if (!cholesky.factorize(structure, assemble, pool).ok())
      throw Error("the world's information matrix is singular");
  }
};

void count_flops(benchmark::State& state, double flops) {
  state.counters["GFlop/s"] =
      benchmark::Counter(flops * 1e-9, benchmark::Counter::kIsIterationInvariantRate);
}

template <int D>
void factorize_by_fronts(benchmark::State& state) {
  Fronts fronts(SolvedWorld<D>::of_size(state.range(0)).map.information);
  for (auto _ : state) fronts.factorize();
  count_flops(state, fronts.structure.statistics.flops);
}
MAPJOIN_KERNEL(factorize_by_fronts);

template <int D>
void factorize_by_fronts_on_two_threads(benchmark::State& state) {
  Fronts fronts(SolvedWorld<D>::of_size(state.range(0)).map.information, 2);
  for (auto _ : state) fronts.factorize();
  count_flops(state, fronts.structure.statistics.flops);
}
BENCHMARK(factorize_by_fronts_on_two_threads<2>)->Arg(10000)->Arg(50000)->UseRealTime();
BENCHMARK(factorize_by_fronts_on_two_threads<3>)->Arg(1000)->Arg(10000)->UseRealTime();

/// Forward substitution comes with the factorisation; this is the way back.
template <int D>
void substitute_backward(benchmark::State& state) {
  Fronts fronts(SolvedWorld<D>::of_size(state.range(0)).map.information);
  fronts.factorize();
  Eigen::VectorXd x(fronts.matrix.scalars());
  for (auto _ : state) {
    fronts.cholesky.solve(x);
    benchmark::DoNotOptimize(x.data());
  }
}
MAPJOIN_KERNEL(substitute_backward);

/// Forward and backward, one right-hand side.
template <int D>
void substitute_both_ways(benchmark::State& state) {
  Fronts fronts(SolvedWorld<D>::of_size(state.range(0)).map.information);
  fronts.factorize();
  Eigen::MatrixXd x = fronts.b;
  for (auto _ : state) {
    fronts.cholesky.solve_in_place(x);
    benchmark::DoNotOptimize(x.data());
    x = fronts.b;
  }
}
MAPJOIN_KERNEL(substitute_both_ways);

/// CHOLMOD in the block order, the first pose left out: column by column or by supernodes, as its
/// operation count says. Copying the numbers in is part of it.
template <int D>
SparseCholesky analyzed_by_cholmod(const SymmetricBlockMatrix& matrix) {
  std::vector<int> dropped(at(matrix.dim(0)));
  std::iota(dropped.begin(), dropped.end(), 0);
  SparseCholesky out;
  out.analyze(matrix, dropped);
  return out;
}

template <int D>
void factorize_by_cholmod(benchmark::State& state) {
  const SymmetricBlockMatrix& matrix = SolvedWorld<D>::of_size(state.range(0)).map.information;
  SparseCholesky cholesky = analyzed_by_cholmod<D>(matrix);
  for (auto _ : state) {
    if (cholesky.factorize(matrix) >= 0) throw Error("the world's information matrix is singular");
  }
  count_flops(state, cholesky.flops());
}
MAPJOIN_KERNEL(factorize_by_cholmod);

template <int D>
void substitute_by_cholmod(benchmark::State& state) {
  const SymmetricBlockMatrix& matrix = SolvedWorld<D>::of_size(state.range(0)).map.information;
  SparseCholesky cholesky = analyzed_by_cholmod<D>(matrix);
  if (cholesky.factorize(matrix) >= 0) throw Error("the world's information matrix is singular");
  const Eigen::MatrixXd b = Eigen::VectorXd::LinSpaced(matrix.scalars(), -1.0, 1.0);
  for (auto _ : state) benchmark::DoNotOptimize(cholesky.solve(b).data());
}
MAPJOIN_KERNEL(substitute_by_cholmod);

}  // namespace

}  // namespace mapjoin::benchmarks
