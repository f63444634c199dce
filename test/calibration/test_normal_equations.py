import numpy as np
import pytest

from rf_pointing.calibration.normal_equations import NormalEquations, eliminate, equations_of, pass_equations

NAMES = ("azimuth_offset", "collimation", "droop")
ALL = np.arange(3)


def rows_of(matrix, right):
    return np.asfortranarray(np.column_stack([matrix, right]))


def test_triangle_keeps_all_inner_products(random):
    rows = random.normal(size=(50, 4))
    expected = rows.T @ rows
    factor = equations_of(np.asfortranarray(rows))
    assert np.allclose(factor.T @ factor, expected, rtol=1e-12)
    assert np.array_equal(factor, np.triu(factor))


def test_solution_covariance_and_condition_agree_with_numpy(random):
    matrix, right = random.normal(size=(60, 3)) * [1.0, 1e3, 1e-3], random.normal(size=60)
    equations = NormalEquations(NAMES)
    equations.add_blocks([(rows_of(matrix[:20], right[:20]), ALL), (rows_of(matrix[20:], right[20:]), ALL)])
    found = equations.solve()
    expected, square, _, _ = np.linalg.lstsq(matrix, right, rcond=None)
    assert found.values == pytest.approx(expected, rel=1e-10)
    assert np.allclose(found.covariance, np.linalg.inv(matrix.T @ matrix), rtol=1e-9)
    assert found.condition == pytest.approx(np.linalg.cond(matrix / np.linalg.norm(matrix, axis=0)), rel=1e-9)
    assert found.residual_square == pytest.approx(float(square[0]), rel=1e-10)


def test_a_prior_is_one_more_equation(random):
    matrix, right = random.normal(size=(20, 3)), random.normal(size=20)
    equations = NormalEquations(NAMES)
    equations.add_blocks([(rows_of(matrix, right), ALL)])
    equations.add_prior("droop", 0.5, 0.1)
    more = np.vstack([matrix, [0.0, 0.0, 10.0]])
    expected = np.linalg.lstsq(more, np.append(right, 5.0), rcond=None)[0]
    assert equations.solve().values == pytest.approx(expected, rel=1e-10)
    with pytest.raises(ValueError, match="prior sigma of droop=0 must be > 0"):
        equations.add_prior("droop", 0.5, 0)


def test_badly_scaled_but_separable_columns_are_solved(random):
    matrix = random.normal(size=(30, 3)) * [1.0, 1e-9, 1e9]
    equations = NormalEquations(NAMES)
    equations.add_blocks([(rows_of(matrix, matrix @ [1.0, 2e9, 3e-9]), ALL)])
    assert equations.solve().values == pytest.approx([1.0, 2e9, 3e-9], rel=1e-9)


def test_an_unknown_that_no_equation_touches_is_named(random):
    equations = NormalEquations(NAMES)
    equations.add_blocks([(rows_of(random.normal(size=(30, 2)), random.normal(size=30)), np.array([0, 2]))])
    with pytest.raises(ValueError, match="30 equations do not determine collimation"):
        equations.solve()


def test_each_pass_has_the_inner_products_of_its_own_rows_be_it_shorter_than_they_are_wide(random):
    passes = random.permutation(np.repeat([9, 4, 7, 2], [1, 3, 6, 40]))
    rows = random.normal(size=(len(passes), 5))
    numbers, triangles = pass_equations(rows, passes)
    assert numbers.tolist() == [2, 4, 7, 9]
    for number, equations in zip(numbers, triangles, strict=True):
        own = rows[passes == number]
        np.testing.assert_allclose(equations.T @ equations, own.T @ own, atol=1e-12)


def test_columns_that_are_almost_but_not_quite_inseparable_are_solved(random):
    """A condition number of 0.7e9, whose cheap bound by the norms is beyond the 1e9 that is refused."""
    names = tuple(f"term {k}" for k in range(8))
    matrix, _ = np.linalg.qr(random.normal(size=(40, 8)))
    matrix[:, 7] = matrix[:, 0] + 2.8e-9 * matrix[:, 7]
    truth = np.arange(1.0, 9.0)
    equations = NormalEquations(names)
    equations.add_blocks([(rows_of(matrix, matrix @ truth), np.arange(8))])
    found = equations.solve()
    assert 6e8 < found.condition < 8e8
    assert found.values[1:7] == pytest.approx(truth[1:7], rel=1e-6)
    assert found.values[0] + found.values[7] == pytest.approx(9.0, rel=1e-6)


@pytest.mark.parametrize("own", [1, 3])
def test_parameters_of_the_passes_are_those_of_all_columns_at_once(random, own):
    """Against one least squares of all columns, the prior of the passes' parameters among its rows."""
    passes = np.repeat([2, 5, 9], [6, 30, 14])
    matrix, right = random.normal(size=(50, own + 3)), random.normal(size=50)
    sigma = np.array([0.5, 2.0, 0.1])[:own]
    numbers, triangles = pass_equations(np.column_stack([matrix, right]), passes)
    heads, rest = eliminate(numbers, triangles, sigma)
    equations = NormalEquations(NAMES)
    equations.add_equations(rest.reshape(-1, 4), 50)
    solution = equations.solve()
    wide = np.zeros((50 + 3 * own, 3 * own + 3))
    wide[:50, 3 * own :] = matrix[:, own:]
    for k, number in enumerate((2, 5, 9)):
        rows = np.flatnonzero(passes == number)
        wide[rows, k * own : (k + 1) * own] = matrix[rows, :own]
    wide[50:, : 3 * own] = np.diag(np.tile(1.0 / sigma, 3))
    expected, square, *_ = np.linalg.lstsq(wide, np.append(right, np.zeros(3 * own)), rcond=None)
    covariance = np.linalg.inv(wide.T @ wide)
    np.testing.assert_allclose(solution.values, expected[3 * own :], rtol=1e-9)
    np.testing.assert_allclose(solution.covariance, covariance[3 * own :, 3 * own :], rtol=1e-9)
    assert solution.residual_square == pytest.approx(float(square[0]), rel=1e-9)
    assert heads.passes.tolist() == [2, 5, 9]
    values, root = heads.joint(
        solution.values[np.newaxis].repeat(3, 0), np.linalg.cholesky(solution.covariance)[np.newaxis].repeat(3, 0)
    )
    np.testing.assert_allclose(values[:, :own].ravel(), expected[: 3 * own], rtol=1e-9, atol=1e-12)
    variance = np.einsum("gij,gij->gi", root, root)
    np.testing.assert_allclose(variance[:, :own].ravel(), np.diag(covariance)[: 3 * own], rtol=1e-9)


def test_what_groups_have_in_common_is_eliminated_as_if_all_columns_were_solved_at_once(random):
    """Own errors scatter about what a turn makes of their group's error: against one least squares."""
    groups, turns = np.array([0, 1, 0, 1, 0]), random.normal(size=(5, 2, 2))
    passes = np.repeat(np.arange(5), 12)
    matrix, right = random.normal(size=(60, 5)), random.normal(size=60)
    own_sigma, group_sigma = np.array([0.3, 1.5]), np.array([2.0, 0.7])
    numbers, factors = pass_equations(np.column_stack([matrix, right]), passes)
    factors = np.insert(factors, [2] * 2, 0.0, axis=2)
    expected = np.concatenate([turns, np.zeros((5, 2, 3))], axis=2)
    heads, rest = eliminate(numbers, factors, own_sigma, expected)
    _, factors = pass_equations(rest.reshape(-1, 6), np.repeat(groups, rest.shape[1]))
    wider, rest = eliminate(np.arange(2), factors, group_sigma)
    equations = NormalEquations(NAMES)
    equations.add_equations(rest.reshape(-1, 4), 60)
    solution = equations.solve()
    root = np.linalg.cholesky(solution.covariance)[np.newaxis]
    values, root = wider.joint(solution.values[np.newaxis].repeat(2, 0), root.repeat(2, 0))
    values, root = heads.joint(values[groups], root[groups])
    # Columns: errors of five passes, of two groups, terms.
    wide = np.zeros((60 + 10 + 4, 10 + 4 + 3))
    for k in range(5):
        rows = np.flatnonzero(passes == k)
        wide[rows, 2 * k : 2 * k + 2] = matrix[rows, :2]
        prior = slice(60 + 2 * k, 62 + 2 * k)
        wide[prior, 2 * k : 2 * k + 2] = np.diag(1.0 / own_sigma)
        wide[prior, 10 + 2 * groups[k] : 12 + 2 * groups[k]] = -turns[k] / own_sigma[:, np.newaxis]
    wide[:60, 14:] = matrix[:, 2:]
    wide[70:, 10:14] = np.diag(np.tile(1.0 / group_sigma, 2))
    every = np.linalg.lstsq(wide, np.append(right, np.zeros(14)), rcond=None)[0]
    covariance = np.linalg.inv(wide.T @ wide)
    np.testing.assert_allclose(solution.values, every[14:], rtol=1e-9)
    np.testing.assert_allclose(solution.covariance, covariance[14:, 14:], rtol=1e-9)
    np.testing.assert_allclose(values[:, :2].ravel(), every[:10], rtol=1e-8, atol=1e-12)
    spread = np.einsum("gij,gij->gi", root, root)[:, :2].ravel()
    np.testing.assert_allclose(spread, np.diag(covariance)[:10], rtol=1e-9)


@pytest.mark.parametrize("scales", [(1.0, 1.0, 1.0), (1e-3, 1.0, 1e3), (1e3, 1e-3, 1.0)])
def test_inseparable_columns_are_named_whatever_their_units(random, scales):
    matrix = random.normal(size=(30, 3))
    matrix[:, 2] = matrix[:, 0]
    equations = NormalEquations(NAMES)
    equations.add_blocks([(rows_of(matrix * scales, random.normal(size=30)), ALL)])
    with pytest.raises(ValueError, match=r"cannot separate azimuth_offset \+ droop: fix one"):
        equations.solve()


def test_fewer_equations_than_unknowns_determine_none_of_them(random):
    equations = NormalEquations(NAMES)
    equations.add_blocks([(rows_of(random.normal(size=(2, 3)), random.normal(size=2)), ALL)])
    with pytest.raises(ValueError, match="2 equations do not determine azimuth_offset, collimation, droop: "):
        equations.solve()
    equations.add_prior("droop", 0.5, 0.1)
    assert equations.solve().residual_square == pytest.approx(0.0, abs=1e-20)
