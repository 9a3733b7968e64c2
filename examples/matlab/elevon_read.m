function [data, units] = elevon_read(file, clock)
% ELEVON_READ  A recording of Elevon (.mat) as a timetable; in Octave, which has none, as a struct.
%   [data, units] = elevon_read('run.mat')          of its only clock
%   [data, units] = elevon_read('run.mat', 'main')  of one of several
%   units: struct, SI unit of each channel.
  content = load(file);
  if ~isfield(content, 'elevon') || ~isfield(content, 'units')
    error('elevon:file', '%s: is no recording of Elevon', file);
  end
  clocks = setdiff(fieldnames(content), {'elevon', 'units'});
  if nargin < 2
    if numel(clocks) ~= 1
      error('elevon:clock', '%s: name one of its clocks: %s', file, strjoin(clocks', ', '));
    end
    clock = clocks{1};
  elseif ~any(strcmp(clock, clocks))
    error('elevon:clock', '%s: no clock %s; clocks: %s', file, clock, strjoin(clocks', ', '));
  end
  data = content.(clock);
  units = content.units;
  if exist('OCTAVE_VERSION', 'builtin')
    return
  end
  names = setdiff(fieldnames(data), {'time'}, 'stable');
  columns = cellfun(@(name) data.(name), names', 'UniformOutput', false);
  data = timetable(seconds(data.time), columns{:}, 'VariableNames', names');
  data.Properties.VariableUnits = cellfun(@(name) units.(name), names', 'UniformOutput', false);
end
