"""A result as a notebook has it: with what goes beyond its file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Unpack

from algid import results
from algid.api.options import LogOptions, ProfileLike, meant

if TYPE_CHECKING:
    import polars as pl
    from plotly.graph_objects import Figure

    from algid.identification.recordings import LogLike


class Result(results.Result):  # noqa: D101
    __doc__ = results.Result.__doc__

    @classmethod
    def of(cls, plain: results.Result) -> Result:
        """The result with these methods."""
        return plain if isinstance(plain, cls) else cls.model_construct(**dict(plain))

    def predict(
        self,
        log: LogLike,
        *,
        loaded: bool = False,
        profile: ProfileLike | None = None,
        **options: Unpack[LogOptions],
    ) -> pl.DataFrame:
        """The torque that the result predicts along a log, beside the measured one.

        Parameters
        ----------
        log : path, `Log`, pandas or polars frame, or dict of arrays
        loaded : bool
            Whether the arm carried the payload.
        profile : Profile, path of one, or dict of what would stand in its file
            Where it is silent, what was said of the result's logs.
        **options : settings of `Profile` by their names

        Returns
        -------
        polars.DataFrame
            A row a sample: t in s, theta1, theta2 in rad, omega1, omega2 in rad/s, tau1, tau2,
            tau1_predicted, tau2_predicted in N m. The prediction is smoothed as far as the angles'
            noise asks, and NaN at both ends of a stretch, where the smoother has no samples.

        Raises
        ------
        LogError
            If the log cannot be used.
        ResultError
            If the result lacks a parameter that the prediction needs.
        SettingError
            If a setting is not known or wrong.

        Examples
        --------
        >>> import algid
        >>> log, _ = algid.synthesise("case1", duration=3.0, torque="wide")
        >>> found = algid.identify(log, estimator="weak").predict(log)
        >>> left = (found["tau1"] - found["tau1_predicted"]).fill_nan(None).drop_nulls()
        >>> bool(left.std() < 0.01 * found["tau1"].std())
        True
        """
        from algid.identification.validate import predicted

        own, log = meant(profile, options, log, earlier=self)
        return predicted(self, log, "loaded" if loaded else "unloaded", own)

    def plot(self) -> Figure:
        """The page's figure of every estimate with its 95 % interval, in percent of the estimate.

        Returns
        -------
        plotly.graph_objects.Figure
            A notebook shows it; ``write_image`` and ``write_html`` write it.

        Examples
        --------
        >>> import algid
        >>> log, _ = algid.synthesise("case1", duration=3.0, torque="wide")
        >>> algid.identify(log, estimator="weak").plot().data[0].y[:3]
        ('k1', 'k2', 'k3')
        """
        from plotly.graph_objects import Figure

        from algid.report.figures import intervals

        panels = intervals(self)
        return Figure({"data": panels.data, "layout": panels.layout})

    def __str__(self) -> str:
        from algid.report.terminal import brief

        others = f" and {len(self.more_logs)} more" if self.more_logs else ""
        subject = f"{self.estimator} estimate from {ascii(self.log.path)[1:-1]}{others}"
        return "\n".join([subject, *brief(self)])

    __repr__ = __str__


def read_result(path: str | Path) -> Result:
    """Read a result.

    Parameters
    ----------
    path : str or Path
        The result file, or the folder that holds its `result.json`.

    Returns
    -------
    Result
        One of an earlier schema version comes back as of this one.

    Raises
    ------
    ResultError
        If it is missing, not a result, or of another schema version.

    Examples
    --------
    >>> import tempfile
    >>> import algid
    >>> log, _ = algid.synthesise("case1", duration=3.0, torque="wide")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     made = algid.identify(log, estimator="weak", out=folder, name="arm", report=False)
    ...     algid.read_result(f"{folder}/arm.algid") == made
    True
    """
    return Result.of(results.read_result(path))
