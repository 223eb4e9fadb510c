"""Methods as integrators of BlackJAX, for its argument ``integrator``."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from blackjax.mcmc.integrators import generate_euclidean_integrator, generate_isokinetic_integrator

from nearharmonic.errors import SettingError
from nearharmonic.exchange.method import method_for
from nearharmonic.integrators.tableau import Tableau

__all__ = ["integrator", "isokinetic_integrator"]

Integrator = Callable[..., Callable[..., Any]]


def integrator(method: str | Tableau) -> Integrator:
    """Return a method as ``integrator`` of ``blackjax.hmc``, ``nuts``, ``dynamic_hmc`` and the warm-up.

    A step of a method with kicks first takes ``stages`` gradients of the log density, as the state holds the gradient
    at its position. One with drifts first takes ``stages + 1``: BlackJAX needs log density and gradient at the end of
    each step. A method with kicks first is therefore the better choice.

    Parameters
    ----------
    method : str or Tableau
        Name of a registered integrator, path of a file, or a tableau.

    Returns
    -------
    callable
        ``(logdensity_fn, kinetic_energy_fn) -> step``, and ``step(state, step_size)`` returns the next
        ``IntegratorState``. The step size is in the unit of time of the Hamiltonian, as for ``velocity_verlet``.

    Raises
    ------
    UnknownNameError
        There is no such integrator.
    SettingError
        The method has modified potentials or a processor, or it is not symmetric.

    Notes
    -----
    A step of ``method`` spans ``stages`` gradients. At equal numbers of gradients the step size is ``stages`` times
    as large as for ``velocity_verlet``, and ``num_integration_steps`` is smaller by this factor.

    Methods that require a quadratic kinetic energy keep their order with the Gaussian metrics of BlackJAX. With another
    ``kinetic_energy_fn`` they have order 2; samples are right all the same, as the proposal is accepted or not.

    BlackJAX starts a step from the gradient in the state and cannot see a position that was replaced. After such a
    change call ``init`` of the algorithm, as for its own integrators.

    References
    ----------
    ``blackjax.mcmc.integrators.generate_euclidean_integrator``, which applies the coefficients.

    Examples
    --------
    >>> import blackjax, jax.numpy as jnp, nearharmonic as nh
    >>> fourth = nh.adapters.blackjax.integrator("mclachlan_s4")
    >>> hmc = blackjax.hmc(lambda x: -0.5 * (x**2).sum(), 0.8, jnp.ones(2), 5, integrator=fourth)
    """
    return generate_euclidean_integrator(_coefficients(method))  # type: ignore[no-any-return]


def isokinetic_integrator(method: str | Tableau) -> Integrator:
    """Return a method as ``integrator`` of ``blackjax.mclmc`` and ``adjusted_mclmc``, whose momenta have norm 1.

    Gradients are as for :func:`integrator`: ``stages`` of a method with kicks first, and one more with drifts first.

    Parameters
    ----------
    method : str or Tableau
        Name of a registered integrator, path of a file, or a tableau.

    Returns
    -------
    callable
        ``(logdensity_fn, inverse_mass_matrix) -> step``, and ``step(state, step_size)`` returns the next
        ``IntegratorState`` and the change of the kinetic energy.

    Raises
    ------
    UnknownNameError
        There is no such integrator.
    SettingError
        The method has modified potentials or a processor, it is not symmetric, or it requires a quadratic kinetic
        energy, which isokinetic dynamics do not have.

    References
    ----------
    ``blackjax.mcmc.integrators.generate_isokinetic_integrator``, which applies the coefficients.

    Examples
    --------
    >>> import blackjax, jax, jax.numpy as jnp, nearharmonic as nh
    >>> fourth = nh.adapters.blackjax.isokinetic_integrator("mclachlan_s4")
    >>> mclmc = blackjax.mclmc(lambda x: -0.5 * (x**2).sum(), L=1.5, step_size=0.8, integrator=fourth)
    """
    coefficients = _coefficients(method, quadratic=False)
    return generate_isokinetic_integrator(coefficients)  # type: ignore[no-any-return]


def _coefficients(method: str | Tableau, *, quadratic: bool = True) -> list[float]:
    """Return alternate kicks and drifts, a kick first and last, in the order of BlackJAX."""
    splitting = method_for("BlackJAX", method)
    tableau = splitting.tableau
    if not tableau.symmetric:
        reason = "it is not symmetric, and a proposal must be the start of its reversed proposal"
        raise SettingError(f"{tableau.name} cannot run in BlackJAX: {reason}")
    if tableau.requires and not quadratic:
        reason = f"it requires a {tableau.requires}, which isokinetic dynamics do not have"
        raise SettingError(f"{tableau.name} cannot run in MCLMC: {reason}")
    coefficients = [move.coefficient for move in splitting.moves]
    return coefficients if splitting.first == "kick" else [0.0, *coefficients, 0.0]
